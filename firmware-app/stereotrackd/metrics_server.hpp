#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace stereotrack::daemon {

/// Serves the newest text at http://ADDR:PORT/metrics, in threads of its own at ordinary priority. The library is
/// cpp-httplib. Throws std::runtime_error with one line where the address cannot be had.
class MetricsServer {
 public:
  /// `listen`: as telemetry::parse_endpoint() takes it; port 0: the system chooses.
  explicit MetricsServer(std::string_view listen);
  MetricsServer(const MetricsServer&) = delete;
  MetricsServer& operator=(const MetricsServer&) = delete;
  ~MetricsServer();

  void show(std::string text);
  /// ADDR:PORT where it listens.
  [[nodiscard]] const std::string& where() const noexcept { return where_; }

 private:
  struct Server;
  std::unique_ptr<Server> server_;
  std::mutex mutex_;
  std::string text_;
  std::string where_;
};

}  // namespace stereotrack::daemon
