// Who is open and what they asked, without a network.
#include "hlm/page/web/page_register.h"

#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

TEST_CASE("Requests are taken once and in order, the notice of the end last") {
  PageRegister pages;
  pages.open(7);
  pages.add(7, "a");
  pages.add(7, "b");
  pages.close(7);
  const auto taken = pages.take();
  REQUIRE(taken.size() == 3);
  CHECK(taken[0].text == "a");
  CHECK(taken[1].text == "b");
  CHECK_FALSE(taken[1].closed);
  CHECK(taken[2].page == 7);
  CHECK(taken[2].closed);
  CHECK(pages.take().empty());
}

TEST_CASE("Requests that nobody takes are dropped and counted, the notice of the end is not") {
  PageRegister pages;
  pages.open(1);
  for (std::size_t i = 0; i < PageRegister::kMaxRequests; ++i) {
    CHECK_FALSE(pages.full());
    pages.add(1, std::to_string(i));
  }
  CHECK(pages.full());
  pages.add(1, "too many");
  pages.close(1);
  CHECK(pages.dropped() == 1);
  const auto taken = pages.take();
  REQUIRE(taken.size() == PageRegister::kMaxRequests + 1);
  CHECK(taken.back().closed);
  CHECK_FALSE(pages.full());
}

TEST_CASE("Telemetry is wanted while an open page wants it") {
  PageRegister pages;
  pages.set_telemetry(1, true);
  CHECK_FALSE(pages.telemetry_wanted());
  pages.open(1);
  pages.open(2);
  CHECK_FALSE(pages.telemetry_wanted());
  pages.set_telemetry(2, true);
  CHECK(pages.telemetry_wanted());
  CHECK(pages.telemetry(2));
  CHECK_FALSE(pages.telemetry(1));
  pages.set_telemetry(2, false);
  CHECK_FALSE(pages.telemetry_wanted());
  pages.set_telemetry(1, true);
  pages.close(1);
  CHECK_FALSE(pages.telemetry_wanted());
  CHECK(pages.pages() == 1);
}

TEST_CASE("A page closes once") {
  PageRegister pages;
  pages.open(1);
  pages.close(1);
  pages.close(1);
  pages.close(2);
  CHECK(pages.take().size() == 1);
}

}  // namespace
}  // namespace hlm::ve
