// Does a line of the tick log say every signal exactly, under the right name?
#include "hlm/haptic_server/report/tick_csv.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

std::vector<std::string> split(const std::string& line) {
  REQUIRE(line.back() == '\n');
  std::istringstream stream(line.substr(0, line.size() - 1));
  std::vector<std::string> cells;
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  return cells;
}

/// The record's line, by column name.
std::map<std::string, std::string> written(const TickRecord& record) {
  std::string line;
  append_tick_csv(record, line);
  const std::vector<std::string> names = split(tick_csv_header());
  const std::vector<std::string> cells = split(line);
  REQUIRE(names.size() == cells.size());
  std::map<std::string, std::string> columns;
  for (std::size_t i = 0; i < names.size(); ++i) columns[names[i]] = cells[i];
  REQUIRE(columns.size() == names.size());
  return columns;
}

/// Whether the cell reads back to the very same double.
bool exact(const std::string& cell, double expected) {
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  return error == std::errc{} && end == cell.data() + cell.size() &&
         std::bit_cast<std::uint64_t>(value) == std::bit_cast<std::uint64_t>(expected);
}

TEST_CASE("The columns are those that readers of the log rely on") {
  CHECK(tick_csv_header() ==
        "session,step,time_s,server_state,fault,fade,contact_state,"
        "device_x_m,device_y_m,device_z_m,device_qw,device_qx,device_qy,device_qz,"
        "device_vx_m_per_s,device_vy_m_per_s,device_vz_m_per_s,"
        "device_wx_rad_per_s,device_wy_rad_per_s,device_wz_rad_per_s,hand_measured,hand_observed,"
        "hand_force_x_N,hand_force_y_N,hand_force_z_N,"
        "hand_torque_x_N_m,hand_torque_y_N_m,hand_torque_z_N_m,"
        "proxy_x_m,proxy_y_m,proxy_z_m,proxy_qw,proxy_qx,proxy_qy,proxy_qz,"
        "proxy_vx_m_per_s,proxy_vy_m_per_s,proxy_vz_m_per_s,"
        "proxy_wx_rad_per_s,proxy_wy_rad_per_s,proxy_wz_rad_per_s,"
        "tool_x_m,tool_y_m,tool_z_m,tool_qw,tool_qx,tool_qy,tool_qz,"
        "env_force_x_N,env_force_y_N,env_force_z_N,"
        "env_torque_x_N_m,env_torque_y_N_m,env_torque_z_N_m,"
        "command_force_x_N,command_force_y_N,command_force_z_N,"
        "command_torque_x_N_m,command_torque_y_N_m,command_torque_z_N_m,force_limit,"
        "port_given_J,port_taken_J,port_explained_J,port_tank_J,brought_J,"
        "active_contacts,predicted_contacts,smallest_separation_m,"
        "scene,scene_placements,scene_pieces,scene_left_out,adopted,age_s,"
        "lateness_s,execution_s,overruns,datagrams,dropped\n");
}

TEST_CASE("Random signals read back bit for bit from the column of their name") {
  test::Random random;
  for (int i = 0; i < 100; ++i) {
    TickRecord r;
    r.time = random.uniform(0, 1e5);
    r.X_WD = random.pose(0.2);
    r.X_WP = random.pose(0.2);
    r.X_WT = random.pose(0.2);
    r.V_WD << random.vector(1), random.vector(10);
    r.V_WP << random.vector(1), random.vector(10);
    r.F_hand << random.vector(12), random.vector(1e-9);
    r.F_env << random.vector(1e4), random.vector(1e-300);
    r.F_command << random.vector(12), random.vector(0.6);
    r.smallest_separation = random.uniform(-1e-3, 1e-3);
    auto columns = written(r);
    CHECK(exact(columns["time_s"], r.time));
    CHECK(exact(columns["device_x_m"], r.X_WD.p.x()));
    CHECK(exact(columns["device_z_m"], r.X_WD.p.z()));
    CHECK(exact(columns["device_qw"], r.X_WD.R.w()));
    CHECK(exact(columns["device_qy"], r.X_WD.R.y()));
    CHECK(exact(columns["device_qz"], r.X_WD.R.z()));
    CHECK(exact(columns["device_vy_m_per_s"], r.V_WD[1]));
    CHECK(exact(columns["device_wz_rad_per_s"], r.V_WD[5]));
    CHECK(exact(columns["hand_force_x_N"], r.F_hand[0]));
    CHECK(exact(columns["hand_torque_z_N_m"], r.F_hand[5]));
    CHECK(exact(columns["proxy_y_m"], r.X_WP.p.y()));
    CHECK(exact(columns["proxy_wx_rad_per_s"], r.V_WP[3]));
    CHECK(exact(columns["tool_qx"], r.X_WT.R.x()));
    CHECK(exact(columns["env_force_z_N"], r.F_env[2]));
    CHECK(exact(columns["env_torque_x_N_m"], r.F_env[3]));
    CHECK(exact(columns["command_torque_y_N_m"], r.F_command[4]));
    CHECK(exact(columns["smallest_separation_m"], r.smallest_separation));
  }
}

TEST_CASE("Special numbers read back bit for bit") {
  const double value = GENERATE(0.0, -0.0, 1.0 / 3, 5e-324, 1e308, -1e-308, 0.1 + 0.2,
                                std::numeric_limits<double>::infinity());
  TickRecord r;
  r.age = value;
  CHECK(exact(written(r)["age_s"], value));
}

TEST_CASE("Counts and states are written as whole numbers and words") {
  TickRecord r;
  r.session = std::numeric_limits<std::uint64_t>::max();
  r.step = 12345;
  r.server = ServerState::kFault;
  r.fault = Fault::kOverrun;
  r.fade = Fade::kClientSilent;
  r.contact_state = ProxyContactState::kResting;
  r.hand_measured = r.hand_observed = true;
  r.active_contacts = 4;
  r.predicted_contacts = 16;
  r.scene = 5;
  r.placements = 6;
  r.pieces = 7;
  r.adopted = 77;
  r.overruns = 1;
  r.datagrams = 2;
  r.dropped = 3;
  auto columns = written(r);
  CHECK(columns["session"] == "18446744073709551615");
  CHECK(columns["step"] == "12345");
  CHECK(columns["server_state"] == "fault");
  CHECK(columns["fault"] == "overrun");
  CHECK(columns["fade"] == "client_silent");
  CHECK(columns["contact_state"] == "resting");
  CHECK(columns["hand_measured"] == "1");
  CHECK(columns["hand_observed"] == "1");
  CHECK(columns["active_contacts"] == "4");
  CHECK(columns["predicted_contacts"] == "16");
  CHECK(columns["scene"] == "5");
  CHECK(columns["scene_placements"] == "6");
  CHECK(columns["scene_pieces"] == "7");
  CHECK(columns["adopted"] == "77");
  CHECK(columns["overruns"] == "1");
  CHECK(columns["datagrams"] == "2");
  CHECK(columns["dropped"] == "3");
}

}  // namespace
}  // namespace hlm::server
