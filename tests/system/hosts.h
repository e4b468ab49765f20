// Hosts of a test: network namespaces, joined by virtual cables.
#pragma once

#include <cstdlib>
#include <string>

#include <unistd.h>

namespace hlm::test {

/// A client, and servers that see nothing but it: server i at 10.77.i.1. They go with this object.
class Hosts {
 public:
  explicit Hosts(int servers) : servers_(servers), name_("haptic" + std::to_string(getpid())) {
    made_ = ip("netns add " + client());
    for (int i = 0; i < servers; ++i) made_ = made_ && add(i);
  }
  ~Hosts() {
    for (int i = 0; i < servers_; ++i) ip("netns delete " + server(i));
    ip("netns delete " + client());
  }
  Hosts(const Hosts&) = delete;
  Hosts& operator=(const Hosts&) = delete;

  /// They need root (CAP_SYS_ADMIN) and iproute2.
  bool made() const { return made_; }
  /// Names of the namespaces.
  std::string client() const { return name_ + "c"; }
  std::string server(int i) const { return name_ + "s" + std::to_string(i); }
  static std::string address(int i) { return "10.77." + std::to_string(i) + ".1"; }

 private:
  static bool ip(const std::string& arguments) {
    return std::system(("ip " + arguments + " >/dev/null 2>&1").c_str()) == 0;
  }

  bool add(int i) const {
    const std::string at_server = server(i);
    const std::string at_client = client() + std::to_string(i);
    const std::string network = "10.77." + std::to_string(i);
    return ip("netns add " + at_server) &&
           ip("link add " + at_server + " netns " + at_server + " type veth peer name " +
              at_client + " netns " + client()) &&
           ip("-n " + at_server + " address add " + network + ".1/24 dev " + at_server) &&
           ip("-n " + client() + " address add " + network + ".2/24 dev " + at_client) &&
           ip("-n " + at_server + " link set " + at_server + " up") &&
           ip("-n " + client() + " link set " + at_client + " up");
  }

  int servers_;
  std::string name_;
  bool made_ = false;
};

}  // namespace hlm::test
