#include "client/commands/server_option.h"

#include <cstdint>
#include <string>

#include "client/commands/check.h"

namespace treelight::client {

void AddServerOptions(CLI::App& app, GlobalOptions& global) {
  app.add_option("--server", global.server, "Address of treelightd: HOST:PORT or unix:PATH")
      ->envname("TREELIGHT_SERVER")
      ->check([](const std::string& address) {
        return address.empty() ? "the address is empty" : std::string();
      })
      ->capture_default_str();
  app.add_option_function<double>(
         "--timeout",
         [&global](double seconds) {
           global.timeout = std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
         },
         "Seconds that one call to the server may take, at least 0.001 (default: any time)")
      ->check(NumberIn(0.001, 1e6));
  ConnectionOptions& connection = global.connection;
  app.add_flag("--tls", global.tls, "Speak TLS; the server's CA is one of the system's")
      ->envname("TREELIGHT_CLIENT_TLS");
  app.add_option("--tls-ca", connection.tls_ca, "Speak TLS; PEM file of the server's CA")
      ->envname("TREELIGHT_CLIENT_TLS_CA");
  app.add_option("--tls-cert", connection.tls_certificate,
                 "Speak TLS; PEM file of the certificate to show to the server")
      ->envname("TREELIGHT_CLIENT_TLS_CERT");
  app.add_option("--tls-key", connection.tls_key, "PEM file of its key")
      ->envname("TREELIGHT_CLIENT_TLS_KEY");
  app.add_option("--token-file", connection.token_file,
                 "File with the token to show to the server, as treelightd token printed it")
      ->envname("TREELIGHT_CLIENT_TOKEN_FILE");
  app.add_flag("--insecure", connection.send_token_in_plaintext,
               "Send the token to another machine without TLS")
      ->envname("TREELIGHT_CLIENT_INSECURE");
}

absl::StatusOr<std::unique_ptr<PhotonMapClient>> Connect(const GlobalOptions& global) {
  ConnectionOptions connection = global.connection;
  if (global.tls || !connection.tls_ca.empty() || !connection.tls_certificate.empty() ||
      !connection.tls_key.empty()) {
    connection.transport = Transport::kTls;
  }
  return PhotonMapClient::Connect(global.server, connection, global.timeout);
}

}  // namespace treelight::client
