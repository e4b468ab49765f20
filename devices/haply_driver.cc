// Haply's Inverse3 and Minverse, through the Inverse Service.
#include <array>

#include "hlm/devices/inverse_service.h"
#include "hlm/haptic_server/device/device_driver.h"

namespace hlm::server {
namespace {

constexpr Freedoms kTranslations = 0b000111;
constexpr std::uint8_t kButtonsOfGrip = 4;
/// Cautious, for any model; the data sheet of one's own says more. Mass, and how the service makes
/// its speed, are not documented: usual ones, for the stiffness that they bear.
constexpr std::array<DeviceModel, 2> kHaplyModels{{
    {.name = "Minverse",
     .force = 3,
     .stiffness = 1000,
     .mass = 0.2,
     .delay = 1e-3,
     .step = 20e-6,
     .cutoff = 60},
    {.name = "",
     .force = 5,
     .stiffness = 1500,
     .mass = 0.3,
     .delay = 1e-3,
     .step = 12e-6,
     .cutoff = 60},
}};

DeviceRatings rated_haply(const DeviceModel& model, const ExchangeOptions& exchange) {
  DeviceRatings ratings = ratings_of(model);
  ratings.mass = 0;  // A wrong one would mislead the observer of the hand.
  ratings.exchange_rate = exchange.rate;
  rate_speed(model, model.cutoff, 1 / exchange.rate, ratings);
  ratings.halts = true;
  return ratings;
}

class HaplyDriver final : public DeviceDriver {
 public:
  HaplyDriver();

  std::string_view name() const override { return "haply"; }
  std::string_view purpose() const override {
    return "Haply Inverse3 or Minverse, through the Inverse Service";
  }
  const settings::Table& table() const override { return table_; }
  std::vector<RatedModel> models() const override;
  std::optional<std::string> find_error() const override;
  std::vector<std::string> connected() const override;
  std::unique_ptr<Device> open(double dt) const override;

 private:
  InverseServiceOptions service_;
  ExchangeOptions exchange_;
  /// Cautious, for any model; the data sheet of one's own says more.
  DeviceRatings ratings_{.max_force = 5, .max_torque = 0, .max_stiffness = 1500};
  settings::Table table_;
};

HaplyDriver::HaplyDriver() {
  table_.text("address", service_.address, "HOST:PORT",
              "Where the Inverse Service listens; also as ws://HOST:PORT");
  table_.whole("events", service_.events, {0, 65535},
               "Port where it tells of brakes and stalls, as of 3.5; 0 is not asked");
  table_.yes_no("settings", service_.settings,
                "Whether it is asked, by HTTP, for settings that change forces");
  table_.text("id", service_.device, "ID", "Which Inverse3; '' is the only one");
  table_.text("grip", service_.grip, "ID",
              "Which grip measures orientation and buttons; '' is the only one, if there "
              "is one, none is none");
  table_.choice("handedness", service_.handedness, {"any", "left", "right"},
                "What the device must be set up for");
  table_.choice("force-field", service_.force_field, {"auto", "vector", "values"},
                "What the service calls a force; older ones say values; auto tries both");
  add_keys(table_, exchange_);
  table_.number("rated-force", ratings_.max_force, {0.01, 20, "N"},
                "What the device can exert: see its data sheet");
  table_.number("rated-stiffness", ratings_.max_stiffness, {1, 1e5, "N/m"}, "What it can render");
}

std::optional<std::string> HaplyDriver::find_error() const {
  const std::string address = host_and_port(service_.address);
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == address.size()) {
    return "address " + service_.address +
           " must be HOST:PORT or ws://HOST:PORT, for example localhost:10001";
  }
  return hlm::server::find_error(exchange_);
}

std::vector<RatedModel> HaplyDriver::models() const {
  std::vector<RatedModel> rows;
  for (const DeviceModel& model : kHaplyModels)
    rows.push_back({model, rated_haply(model, exchange_)});
  return rows;
}

std::vector<std::string> HaplyDriver::connected() const {
  const HaplyInventory inventory = InverseService::ask_inventory(service_.address);
  std::vector<std::string> lines;
  for (const HaplyDevice& device : inventory.devices) {
    lines.push_back("Inverse3 " + device.id +
                    (device.handedness.empty() ? "" : ", " + device.handedness + "-handed") +
                    ", by the service at " + service_.address);
  }
  for (const HaplyGrip& grip : inventory.grips) lines.push_back("grip " + grip.id);
  return lines;
}

std::unique_ptr<Device> HaplyDriver::open(double) const {
  const HaplyChoice choice = choose(InverseService::ask_inventory(service_.address), service_);
  DeviceRatings ratings = rated_haply(kHaplyModels.back(), exchange_);
  ratings.max_force = ratings_.max_force;
  ratings.max_stiffness = ratings_.max_stiffness;
  if (choice.grip.empty()) ratings.freedoms = kTranslations;
  if (!choice.grip.empty()) ratings.buttons = kButtonsOfGrip;
  return std::make_unique<ExchangeDevice>(
      "Haply Inverse3 " + choice.device, ratings, exchange_,
      std::make_unique<InverseService>(choosing(choice, service_)));
}

const RegistrationOf<HaplyDriver> haply_registration;

}  // namespace
}  // namespace hlm::server
