#ifndef TREELIGHT_TESTS_HALF_SENT_CALLS_H_
#define TREELIGHT_TESTS_HALF_SENT_CALLS_H_

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>

#include "tests/http2_frames.h"

namespace treelight::testing {

/// A connection to 127.0.0.1 with calls that each send all of their request but its last byte, or
/// far more than a request, as fast as the server takes it, and then stand still: gRPC's own client
/// sends whole messages.
class HalfSentCalls {
 public:
  /// `calls` calls of `path` with a request of `message_bytes`.
  HalfSentCalls(int port, const std::string& path, int calls, std::uint32_t message_bytes)
      : HalfSentCalls(port, path, calls, message_bytes, message_bytes + 4) {}  // prefix less a byte

  /// The same with `sent_bytes` instead, zeros after the request: more empty requests.
  HalfSentCalls(int port, const std::string& path, int calls, std::uint32_t message_bytes,
                std::uint64_t sent_bytes) {
    if (!http2::Connect(socket_, port)) return;
    Send(http2::Preface());
    const std::string headers = http2::CallHeaders(path);
    for (int i = 0; i < calls; ++i) {
      const std::uint32_t id = 2 * static_cast<std::uint32_t>(i) + 1;
      Send(http2::Frame(http2::kHeaders, http2::kEndHeaders, id, headers));
      calls_[id] = {.window = kFirstWindow, .unsent = sent_bytes};
    }
    message_prefix_ = std::string(1, '\0') + http2::Number(message_bytes);
  }
  ~HalfSentCalls() { close(socket_); }
  HalfSentCalls(const HalfSentCalls&) = delete;
  HalfSentCalls& operator=(const HalfSentCalls&) = delete;

  /// Sends what the server has room for, and reads what it says, waiting at most `wait_ms`.
  void Go(int wait_ms) {
    for (auto& [id, call] : calls_) SendSome(id, call);
    pollfd ready{.fd = socket_, .events = POLLIN, .revents = 0};
    if (poll(&ready, 1, wait_ms) <= 0) return;
    char buffer[1 << 16];
    const ssize_t count = recv(socket_, buffer, sizeof(buffer), 0);
    if (count > 0) Read(std::string(buffer, static_cast<std::size_t>(count)));
  }

  std::uint64_t sent_bytes() const { return sent_; }  ///< of requests
  int ended() const { return ended_; }                ///< calls that the server has ended

 private:
  static constexpr std::int64_t kFirstWindow = 65'535;
  struct OneCall {
    std::int64_t window = 0;
    std::uint64_t unsent = 0, sent = 0;
  };

  void Send(const std::string& bytes) {
    for (std::size_t first = 0; first < bytes.size();) {
      const ssize_t count = send(socket_, bytes.data() + first, bytes.size() - first, MSG_NOSIGNAL);
      if (count <= 0) return;
      first += static_cast<std::size_t>(count);
    }
  }
  void SendSome(std::uint32_t id, OneCall& call) {
    constexpr std::int64_t kMost = 16'384;
    while (call.unsent > 0 && call.window > 0 && window_ > 0) {
      const auto length = static_cast<std::size_t>(
          std::min({kMost, call.window, window_, static_cast<std::int64_t>(call.unsent)}));
      std::string body(length, '\0');
      if (call.sent == 0) std::copy(message_prefix_.begin(), message_prefix_.end(), body.begin());
      Send(http2::Frame(http2::kData, 0, id, body));
      call.sent += length, call.unsent -= length, sent_ += length;
      call.window -= static_cast<std::int64_t>(length);
      window_ -= static_cast<std::int64_t>(length);
    }
  }
  void Read(const std::string& bytes) {
    received_ += bytes;
    constexpr std::size_t kHead = 9;
    const auto number = [this](std::size_t at) {
      std::uint32_t big = 0;
      received_.copy(reinterpret_cast<char*>(&big), sizeof(big), at);
      return ntohl(big);
    };
    while (received_.size() >= kHead) {
      const std::size_t length = number(0) >> 8;
      if (received_.size() < kHead + length) return;
      Take(received_[3], received_[4], number(5) & 0x7fffffff, received_.substr(kHead, length));
      received_.erase(0, kHead + length);
    }
  }
  void Take(char type, char flags, std::uint32_t stream, const std::string& body) {
    const auto number = [&body](std::size_t at) {
      std::uint32_t big = 0;
      body.copy(reinterpret_cast<char*>(&big), sizeof(big), at);
      return std::int64_t{ntohl(big)};
    };
    if (type == http2::kSettings && flags != http2::kAck) {
      constexpr char kInitialWindow = 4;
      for (std::size_t at = 0; at + 6 <= body.size(); at += 6) {
        if (body[at + 1] != kInitialWindow) continue;
        for (auto& [id, call] : calls_) call.window += number(at + 2) - first_window_;
        first_window_ = number(at + 2);
      }
      Send(http2::Frame(http2::kSettings, http2::kAck, 0, ""));
    } else if (type == http2::kPing && flags != http2::kAck) {
      Send(http2::Frame(http2::kPing, http2::kAck, 0, body));
    } else if (type == http2::kWindow && stream == 0) {
      window_ += number(0);
    } else if (type == http2::kWindow && calls_.contains(stream)) {
      calls_[stream].window += number(0);
    } else if (type == http2::kReset ||
               (type == http2::kHeaders && (flags & http2::kEndStream) != 0)) {
      ended_ += static_cast<int>(calls_.erase(stream));
    }
  }

  const int socket_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::string message_prefix_, received_;
  std::map<std::uint32_t, OneCall> calls_;  // by stream
  std::int64_t window_ = kFirstWindow, first_window_ = kFirstWindow;
  std::uint64_t sent_ = 0;
  int ended_ = 0;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_HALF_SENT_CALLS_H_
