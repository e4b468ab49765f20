// Haply's 2DIY, a planar pantograph at a serial port.
#include <numbers>

#include "hlm/devices/diy_board.h"
#include "hlm/haptic_server/device/device_driver.h"

namespace hlm::server {
namespace {

constexpr Freedoms kInPlane = 0b000011;
constexpr Range kAngles{-360, 360, "degrees"};
/// Of the kit's third generation, in the middle of its workspace.
constexpr DeviceModel kDiyModel{
    .name = "", .force = 1.6, .stiffness = 500, .mass = 0.2, .delay = 2e-3, .step = 0.1e-3};

DeviceRatings rated_diy(const DeviceRatings& given, const ExchangeOptions& exchange,
                        double cutoff) {
  DeviceRatings ratings = given;
  ratings.delay = kDiyModel.delay;
  ratings.exchange_rate = exchange.rate;
  ratings.position_step = kDiyModel.step;
  rate_speed(kDiyModel, cutoff, 1 / exchange.rate, ratings);
  ratings.freedoms = kInPlane;
  ratings.halts = true;
  return ratings;
}

class DiyDriver final : public DeviceDriver {
 public:
  DiyDriver();

  std::string_view name() const override { return "haply2diy"; }
  std::string_view purpose() const override { return "Haply 2DIY, a pantograph at a serial port"; }
  const settings::Table& table() const override { return table_; }
  std::vector<RatedModel> models() const override;
  std::optional<std::string> find_error() const override;
  /// Serial ports, whatever is at them: a board does not say what it is.
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  DiyBoardOptions board_;
  ExchangeOptions exchange_{.rate = 1000};
  /// What two small motors give anywhere in the middle of the workspace; cautious.
  DeviceRatings ratings_{.max_force = 1.6, .max_torque = 0, .max_stiffness = 500};
  settings::Table table_;
};

DiyDriver::DiyDriver() {
  table_.text("port", board_.port, "FILE", "Serial port; '' is the only one that is listed");
  table_.whole("board", board_.board, {0, 255}, "Number of the board in its frames");
  Pantograph& arms = board_.pantograph;
  table_.number("base", arms.base, {0, 0.5, "m"}, "Distance of the two motors");
  table_.number("upper-arm", arms.upper_arm, {0.01, 0.5, "m"}, "Length of the arms at the motors");
  table_.number("forearm", arms.forearm, {0.01, 0.5, "m"}, "Length of the arms at the handle");
  DiySetup& setup = board_.setup;
  table_.number("first-offset", setup.offset[0], kAngles,
                "Angle of the first arm, of port 2, as the device is opened");
  table_.number("second-offset", setup.offset[1], kAngles, "Angle of the second arm, of port 1");
  table_.number("resolution", setup.resolution, {1, 1e6}, "Counts of an encoder in a turn");
  table_.yes_no("first-clockwise", setup.clockwise[0], "Whether the first motor counts clockwise");
  table_.yes_no("second-clockwise", setup.clockwise[1], "Whether the second motor does");
  table_.number("velocity-cutoff", board_.velocity_cutoff, {1, 1000, "Hz"},
                "Cut-off of the velocity filter");
  add_keys(table_, exchange_);
  table_.number("rated-force", ratings_.max_force, {0.01, 20, "N"}, "What the device can exert");
  table_.number("rated-motor-torque", board_.max_torque, {0.001, 10, "N·m"},
                "What each motor can give; both torques shrink together where one is above");
  table_.number("rated-stiffness", ratings_.max_stiffness, {1, 1e5, "N/m"}, "What it can render");
}

std::optional<std::string> DiyDriver::find_error() const {
  const Pantograph& arms = board_.pantograph;
  const Vector2 start =
      std::numbers::pi / 180 * Vector2(board_.setup.offset[0], board_.setup.offset[1]);
  if (arms.handle(start)) return hlm::server::find_error(exchange_);
  return "base, upper-arm and forearm, with first-offset and second-offset, must be a pantograph "
         "whose forearms meet and are not in line";
}

std::vector<RatedModel> DiyDriver::models() const {
  return {{kDiyModel, rated_diy(ratings_, exchange_, board_.velocity_cutoff)}};
}

std::vector<std::string> DiyDriver::connected() const {
  std::vector<std::string> lines;
  for (const std::string& port : serial_ports()) lines.push_back("serial port " + port);
  return lines;
}

std::unique_ptr<Device> DiyDriver::open(double) const {
  return std::make_unique<ExchangeDevice>("Haply 2DIY",
                                          rated_diy(ratings_, exchange_, board_.velocity_cutoff),
                                          exchange_, std::make_unique<DiyBoard>(board_));
}

const RegistrationOf<DiyDriver> diy_registration;

}  // namespace
}  // namespace hlm::server
