#ifndef TREELIGHT_TESTS_HTTP_GET_H_
#define TREELIGHT_TESTS_HTTP_GET_H_

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace treelight::testing {

/// A connection to 127.0.0.1:`port`, to be closed; -1 where nobody listens.
inline int ConnectTo(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int handle = socket(AF_INET, SOCK_STREAM, 0);
  if (connect(handle, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
    return handle;
  close(handle);
  return -1;
}

/// The whole answer to GET `path` on 127.0.0.1:`port`; empty where nobody answers.
inline std::string HttpGet(int port, const std::string& path) {
  const int handle = ConnectTo(port);
  std::string answer;
  if (handle < 0) return answer;
  const std::string request =
      "GET " + path + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  ssize_t count = send(handle, request.data(), request.size(), MSG_NOSIGNAL);
  char buffer[4096];
  while ((count = recv(handle, buffer, sizeof(buffer), 0)) > 0) {
    answer.append(buffer, static_cast<std::size_t>(count));
  }
  close(handle);
  return answer;
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_HTTP_GET_H_
