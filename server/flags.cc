#include "server/flags.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <istream>
#include <memory>
#include <string_view>
#include <system_error>
#include <vector>

#include "CLI/CLI.hpp"
#include "fmt/format.h"
#include "server/address.h"
#include "server/tell.h"
#include "server/version.h"

namespace treelight::server {
namespace {

constexpr const char* kDescription =
    "treelightd - the Treelight photon map service\n"
    "Every option may also stand in the --config file (listen=\"127.0.0.1:7543\") and in the "
    "environment "
    "(TREELIGHT_LISTEN).";

constexpr const char* kExitCodes =
    "Exit codes: 0 it has drained, or the server asked by healthcheck serves; 1 it cannot serve, "
    "or "
    "the server asked does not; 2 wrong command line; 130 a signal came before it served, or a "
    "second one while it drained.";

/// "--queue-depth" is TREELIGHT_QUEUE_DEPTH in the environment.
std::string Variable(const std::string& option) {
  std::string name = "TREELIGHT_";
  for (const char c : option.substr(2)) {
    name += c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return name;
}

template <typename T>
CLI::Option* Add(CLI::App& app, const std::string& name, T& value, const std::string& description) {
  return app.add_option(name, value, description)->envname(Variable(name))->capture_default_str();
}

/// The flags that are seconds.
struct Seconds {
  explicit Seconds(const Flags& flags)
      : drain(std::chrono::duration<double>(flags.drain).count()),
        stall(std::chrono::duration<double>(flags.server.stall).count()) {}

  double drain, stall, drain_delay = 0;
};

std::chrono::milliseconds ToMilliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(1000 * seconds));
}

/// What is wrong with `text` as a count of at least 1, for CLI11.
std::string CheckCount(const std::string& text) {
  std::uint64_t count = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, count);
  if (error == std::errc() && stop == end && count > 0) return {};
  return fmt::format("'{}' is no whole number of at least 1", text);
}

/// What is wrong with `text`, bytes, as a limit of memory, for CLI11.
std::string CheckMemoryLimit(const std::string& text) {
  // The largest message as it came and parsed, one in a stream, and a part of the answer.
  constexpr std::uint64_t kLeastMiB = 16;
  if (text.starts_with('-')) return fmt::format("'{}' is less than nothing", text);
  std::uint64_t bytes = 0;
  std::from_chars(text.data(), text.data() + text.size(), bytes);
  if (bytes == 0 || bytes >= kLeastMiB << 20) return {};
  return fmt::format("{} bytes are too few, {}MiB is the least with which requests are answered",
                     bytes, kLeastMiB);
}

/// What is wrong with `text` as seconds of at least `least`, for CLI11. Its Range takes "nan".
std::string CheckSeconds(const std::string& text, double least) {
  constexpr double kDay = 86'400;
  double seconds = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, seconds);
  if (error == std::errc() && stop == end && seconds >= least && seconds <= kDay) return {};
  return fmt::format("'{}' is no number in [{}, {}]", text, least, kDay);
}

/// `text` as it can stand in one line of a terminal.
std::string Printable(std::string_view text) {
  constexpr std::size_t kLongest = 80;
  std::string line;
  for (const char c : text.substr(0, kLongest)) {
    line += std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '?';
  }
  return text.size() > kLongest ? line + "..." : line;
}

/// INI files in which a quote that is opened is closed.
class ConfigFile : public CLI::ConfigTOML {
 public:
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    auto options = CLI::ConfigTOML::from_config(input);
    for (const CLI::ConfigItem& item : options) {
      for (const std::string& text : item.inputs) {
        if (text.starts_with('"') || text.starts_with('\'')) {
          throw CLI::ConfigError(fmt::format("the quote of {}={} is not closed", item.name, text));
        }
      }
    }
    return options;
  }
};

/// "TREELIGHT_QUEUE_DEPTH: " where `what`, of an option that the command line does not have, is
/// about the value that the environment gives it; else empty.
std::string Culprit(const std::string& what, const std::vector<std::string>& arguments) {
  const std::size_t begin = what.find("--");
  if (begin == what.npos) return {};
  const std::size_t end = what.find_first_not_of("abcdefghijklmnopqrstuvwxyz-", begin);
  const std::string option = what.substr(begin, end - begin);
  const bool told = std::ranges::any_of(arguments, [&](const std::string& argument) {
    return argument == option || argument.starts_with(option + "=");
  });
  const std::string variable = Variable(option);
  const char* const value = std::getenv(variable.c_str());
  const bool is_it = !told && value != nullptr && what.find(value) != what.npos;
  return is_it ? variable + ": " : std::string();
}

/// What is wrong, in one line.
std::string Explain(const CLI::ParseError& error, CLI::App& app,
                    const std::vector<std::string>& arguments) {
  constexpr std::string_view kNotAnOption = "INI was not able to parse ";
  const std::string what = error.what();
  const bool not_an_option = what.starts_with(kNotAnOption);
  if (!not_an_option && dynamic_cast<const CLI::ConfigError*>(&error) == nullptr)
    return Culprit(what, arguments) + what;
  return fmt::format("file '{}' of --config: {}", app.get_config_ptr()->as<std::string>(),
                     not_an_option ? fmt::format("no option is named '{}'",
                                                 Printable(what.substr(kNotAnOption.size())))
                                   : Printable(what));
}

void AddOptions(CLI::App& app, Flags& flags, Seconds& seconds, std::int64_t& slow_ms,
                std::string& socket_mode) {
  ServerOptions& server = flags.server;
  Add(app, "--listen", server.listen, "HOST:PORT, port 0 for a free one; or unix:/PATH")
      ->check(
          [](const std::string& listen) { return std::string(CheckAddress(listen).message()); });
  app.add_flag("--insecure", server.allow_insecure,
               "Listen where other machines reach it, without TLS or tokens")
      ->envname(Variable("--insecure"));
  Add(app, "--tls-cert", server.tls.certificate,
      "PEM file of the server's certificate and those up to its CA; read again when it changes");
  Add(app, "--tls-key", server.tls.key, "PEM file of its private key; read again too");
  Add(app, "--tls-client-ca", server.tls.client_ca,
      "PEM file of the CAs of which clients must show a certificate; read again too");
  Add(app, "--token-file", server.token_file,
      "Hashes of the tokens of those who may call, by treelightd token; read again when it "
      "changes");
  Add(app, "--socket-mode", socket_mode, "Permissions of a Unix socket, octal")
      ->check([](const std::string& text) {
        const bool octal = text.size() <= 4 && text.find_first_not_of("01234567") == text.npos;
        return octal && !text.empty() && std::stoul(text, nullptr, 8) <= 0777
                   ? std::string()
                   : fmt::format("'{}' are no permissions in octal, 0660 say", text);
      });
  Add(app, "--device", flags.device.device,
      "Device, by index or part of its name, or several GPUs, 0,1 say: maps lie on all of them, "
      "large batches are "
      "split; the first GPU, else the CPU");
  Add(app, "--cache-dir", flags.device.cache_directory, "Folder of compiled kernels");
  Limits& limits = server.limits;
  Add(app, "--max-photons", limits.max_photons, "Photons in one map")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{kLeafBit - 1}));
  Add(app, "--max-queries", limits.max_queries, "Queries in one batch")->check(CheckCount);
  Add(app, "--max-neighbors", limits.max_neighbors, "Neighbours in the answer of one batch")
      ->check(CheckCount);
  Add(app, "--queue-depth", server.queue_depth, "Requests that may wait for the device")
      ->check(CheckCount);
  Add(app, "--build-slots", server.build_slots, "Builds that may be open, uploads included")
      ->check(CheckCount);
  Add(app, "--max-calls", server.max_calls, "Calls that may be open at once")->check(CheckCount);
  Add(app, "--max-connections", server.max_connections,
      "Connections that may be open at once; further ones are closed")
      ->check(CheckCount);
  Add(app, "--memory-limit", server.memory_limit,
      "Bytes of host memory for uploads, messages, answers, and maps on a CPU; units as 4GiB; "
      "0: half of what the machine or its control group has")
      ->transform(CLI::AsSizeValue(false))
      ->check(CheckMemoryLimit);
  Add(app, "--stall-seconds", seconds.stall,
      "Time that a client may stand still in an upload or an answer")
      ->check([](const std::string& text) { return CheckSeconds(text, 0.001); });
  Add(app, "--drain-delay", seconds.drain_delay,
      "Seconds after SIGTERM in which health says NOT_SERVING and new calls are served still")
      ->check([](const std::string& text) { return CheckSeconds(text, 0); });
  Add(app, "--drain-seconds", seconds.drain, "Time for open calls to finish after that")
      ->check([](const std::string& text) { return CheckSeconds(text, 0); });
  Add(app, "--data-dir", server.data_folder,
      "Folder in which maps survive the server; without it they live in memory alone")
      ->check([](const std::string& folder) {
        return folder.empty() ? std::string("it names no folder; without it maps live in memory")
                              : std::string();
      });
  Add(app, "--log-file", server.log_file, "Request log, opened anew at SIGHUP; stderr without it");
  Add(app, "--slow-ms", slow_ms,
      "Requests that take longer have \"slow\":true in the log and are counted; 0: none")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{86'400'000}));
  Add(app, "--metrics-listen", server.metrics_listen,
      "HOST:PORT of GET /metrics for Prometheus, 127.0.0.1:9464 say; none without it")
      ->check(
          [](const std::string& listen) { return std::string(CheckAddress(listen).message()); });
}

}  // namespace

std::variant<Flags, HealthCheck, TokenRequest, FolderCheck, Exit> ParseFlags(
    int argc, const char* const* argv) {
  Flags flags;
  Seconds seconds(flags);
  CLI::App app(kDescription, "treelightd");
  app.set_version_flag("--version", fmt::format("treelightd {}", kVersion));
  std::int64_t slow_ms = flags.server.slow.count();
  std::string socket_mode = fmt::format("{:04o}", flags.server.socket_mode);
  AddOptions(app, flags, seconds, slow_ms, socket_mode);
  app.footer(kExitCodes);
  CLI::App* const health_check = app.add_subcommand(
      "healthcheck", "Ask the server at --listen whether it serves: exit code 0, else 1");
  health_check->fallthrough();  // its options are the server's
  CLI::App* const token = app.add_subcommand(
      "token", "Print a new token for client NAME, and add its hash to --token-file");
  std::string token_name;
  token->add_option("NAME", token_name, "Name of the client in the request log")->required();
  token->fallthrough();
  CLI::App* const fsck = app.add_subcommand(
      "fsck",
      "Check the maps in --data-dir; exit code 1 where one is damaged or cannot be read; changes "
      "nothing");
  fsck->fallthrough();
  app.require_subcommand(0, 1);
  const char* config = std::getenv("TREELIGHT_CONFIG");
  const bool has_config = config != nullptr && *config != '\0';
  // A file that is named has to be there.
  app.set_config("--config", has_config ? config : "", "File of options, name=value", has_config);
  app.config_formatter(std::make_shared<ConfigFile>());
  app.allow_config_extras(CLI::config_extras_mode::error);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& asked) {  // --help, --version
    app.exit(asked);
    return Exit{0};
  } catch (const CLI::ParseError& error) {
    Tell(Explain(error, app, {argv + 1, argv + argc}));
    return Exit{kExitWrongUsage};
  }
  flags.drain = ToMilliseconds(seconds.drain);
  flags.drain_delay = ToMilliseconds(seconds.drain_delay);
  flags.server.slow = std::chrono::milliseconds(slow_ms);
  flags.server.stall = ToMilliseconds(seconds.stall);
  flags.server.socket_mode = static_cast<unsigned>(std::stoul(socket_mode, nullptr, 8));
  const auto wrong = [](const absl::Status& status) {
    Tell(std::string(status.message()));
    return Exit{kExitWrongUsage};
  };
  if (health_check->parsed()) {
    if (auto status = CheckTlsOptions(flags.server.tls); !status.ok()) return wrong(status);
    return HealthCheck{flags.server.listen, flags.server.tls};
  }
  if (fsck->parsed()) {
    if (!flags.server.data_folder.empty()) return FolderCheck{flags.server.data_folder};
    Tell("fsck: say which folder, --data-dir");
    return Exit{kExitWrongUsage};
  }
  if (token->parsed()) {
    if (!flags.server.token_file.empty()) return TokenRequest{token_name, flags.server.token_file};
    Tell("token: say which file gets the hash, --token-file");
    return Exit{kExitWrongUsage};
  }
  if (auto status = CheckOptions(flags.server); !status.ok()) return wrong(status);
  return flags;
}

}  // namespace treelight::server
