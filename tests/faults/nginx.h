#ifndef TREELIGHT_TESTS_FAULTS_NGINX_H_
#define TREELIGHT_TESTS_FAULTS_NGINX_H_

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/server_process.h"

// nginx with the configurations of docker/, on loopback.
namespace treelight::testing {

/// A port that is free at present.
inline int FreePort() {
  const int handle = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  EXPECT_EQ(bind(handle, reinterpret_cast<sockaddr*>(&address), length), 0);
  EXPECT_EQ(getsockname(handle, reinterpret_cast<sockaddr*>(&address), &length), 0);
  close(handle);
  return ntohs(address.sin_port);
}

inline void Replace(std::string& text, const std::string& from, const std::string& to) {
  ASSERT_NE(text.find(from), std::string::npos) << from;
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
}

inline std::string ReadText(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// nginx with `configuration`, but for addresses and paths.
class Nginx {
 public:
  Nginx(const std::string& folder, std::vector<std::string> servers, std::string configuration)
      : folder_(folder),
        servers_(std::move(servers)),
        configuration_(std::move(configuration)),
        port_(FreePort()) {
    Configure(servers_.size());
    // The program's own name and what follows it come last, which sh takes no notice of.
    process_ = std::make_unique<Process>(
        std::vector<std::string>{
            "sh", "-c", "exec nginx -p " + folder_ + " -c " + file() + " -g 'daemon off;'"},
        std::vector<std::string>{});
  }
  ~Nginx() {
    process_->Signal(SIGTERM);
    process_->Wait();
  }

  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  std::string err() const { return process_->err(); }

  /// Waits until it takes connections.
  bool WaitUntilReady() const {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    bool connected = false;
    while (!connected && std::chrono::steady_clock::now() < end) {
      const int handle = socket(AF_INET, SOCK_STREAM, 0);
      connected = connect(handle, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
      close(handle);
      if (!connected) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return connected;
  }

  /// Takes a server out, the number of servers for none, as an operator does before a drain, and
  /// waits until no worker knows it any more; how long that took.
  std::chrono::milliseconds TakeOut(std::size_t out) {
    const auto begin = std::chrono::steady_clock::now();
    const std::set<int> old = Workers();
    Configure(out);
    process_->Signal(SIGHUP);
    const auto took = [&] {
      return std::chrono::duration_cast<std::chrono::milliseconds>(
          std::chrono::steady_clock::now() - begin);
    };
    const auto left = [&] {
      return std::ranges::any_of(Workers(), [&](int worker) { return old.contains(worker); });
    };
    while (left() && took() < std::chrono::seconds(60)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return took();
  }

 private:
  std::string file() const { return folder_ + "/nginx.conf"; }
  /// Process ids.
  std::set<int> Workers() const {
    const std::string pid = std::to_string(process_->pid());
    std::ifstream file("/proc/" + pid + "/task/" + pid + "/children");
    return {std::istream_iterator<int>(file), std::istream_iterator<int>()};
  }
  void Configure(std::size_t out) const {
    std::string text = configuration_;
    Replace(text, "/tmp/", folder_ + "/");
    const std::string tls = "/etc/treelight/tls/";
    if (text.find(tls) != std::string::npos) Replace(text, tls, folder_ + "/");
    Replace(text, "/dev/stdout", folder_ + "/calls.log");
    Replace(text, "listen 7543", "listen " + address());
    Replace(text, "worker_processes auto", "worker_processes 2");
    Replace(text, "worker_rlimit_nofile 65536;", "");
    Replace(text, "fail_timeout=5s", "fail_timeout=2s");
    Replace(text, "keepalive_time 5s", "keepalive_time 500ms");
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      Replace(text, "server treelight-" + std::to_string(i) + ":7543",
              "server " + servers_[i] + (i == out ? " down" : ""));
    }
    std::ofstream(file() + ".new") << text;
    std::filesystem::rename(file() + ".new", file());
  }

  const std::string folder_;
  const std::vector<std::string> servers_;
  const std::string configuration_;
  const int port_;
  std::unique_ptr<Process> process_;
};

/// The text of nginx.conf in docker/kubernetes.yaml.
inline std::string ManifestConfiguration() {
  std::istringstream manifest(ReadText(TREELIGHT_KUBERNETES));
  std::string text;
  bool inside = false;
  for (std::string line; std::getline(manifest, line);) {
    if (line == "---") inside = false;
    if (inside) text += (line.empty() ? line : line.substr(4)) + "\n";
    if (line == "  nginx.conf: |") inside = true;
  }
  return text;
}

/// docker/nginx.conf with the lines for TLS, as its comments say.
inline std::string ConfigurationWithTls() {
  std::istringstream file(ReadText(TREELIGHT_NGINX_CONF));
  std::string text;
  for (std::string line; std::getline(file, line);) {
    if (line.ends_with(" listen 7543 http2;") || line.ends_with(" grpc_pass grpc://treelight;") ||
        line.find("in place of") != std::string::npos) {
      continue;
    }
    const std::size_t mark = line.find("#   ");
    if (mark != std::string::npos) line.erase(mark, 4);
    text += line + "\n";
  }
  return text;
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_FAULTS_NGINX_H_
