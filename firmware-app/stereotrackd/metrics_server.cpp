#include "firmware-app/stereotrackd/metrics_server.hpp"

#include <httplib.h>

#include <stdexcept>
#include <thread>
#include <utility>

#include "drivers/telemetry/endpoint.hpp"

namespace stereotrack::daemon {

struct MetricsServer::Server {
  httplib::Server http;
  std::thread thread;
};

MetricsServer::MetricsServer(std::string_view listen) : server_(std::make_unique<Server>()) {
  const telemetry::Endpoint endpoint = telemetry::parse_endpoint(listen, true);
  const std::string text = telemetry::to_string(endpoint);
  std::string host = text.substr(0, text.rfind(':'));
  if (host.starts_with('[')) host = host.substr(1, host.size() - 2);
  httplib::Server& http = server_->http;
  http.new_task_queue = [] { return new httplib::ThreadPool(1); };
  http.set_keep_alive_max_count(1);
  http.set_keep_alive_timeout(1);  // an idle client holds the one worker, and the end of the daemon, no longer
  http.set_read_timeout(1, 0);
  http.set_write_timeout(1, 0);
  http.Get("/metrics", [this](const httplib::Request&, httplib::Response& response) {
    const std::lock_guard lock(mutex_);
    response.set_content(text_, "text/plain; version=0.0.4");
  });
  int port = endpoint.port();
  const bool bound = port == 0 ? (port = http.bind_to_any_port(host)) > 0 : http.bind_to_port(host, port);
  if (!bound) {
    throw std::runtime_error("metrics.listen " + std::string(listen) +
                             ": cannot listen there: is the address this machine's, and the port free?");
  }
  where_ = text.substr(0, text.rfind(':') + 1) + std::to_string(port);
  server_->thread = std::thread([&http] { (void)http.listen_after_bind(); });
  // stop() of a server that does not listen yet does nothing, and join() would wait for ever.
  while (!http.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

MetricsServer::~MetricsServer() {
  server_->http.stop();
  server_->thread.join();
}

void MetricsServer::show(std::string text) {
  const std::lock_guard lock(mutex_);
  text_ = std::move(text);
}

}  // namespace stereotrack::daemon
