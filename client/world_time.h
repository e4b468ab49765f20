// How far a world goes on in a frame, so that its time is the hand's.
#pragma once

namespace hlm {

/// A frame that comes late is made up for as soon as the server has reported what the hand did
/// meanwhile: a body that it carries must fall for as long as it is carried. Some time is not made
/// up for: that of a silence in which the server let go of the bodies, and what an engine takes
/// that is slower than its world, and would only come later still. Nor for more than a silence
/// altogether: frames in which no steps were asked for are a pause.
class WorldTime {
 public:
  /// period: nominal, of the frames, s, > 0.
  explicit WorldTime(double period) : period_(period) {}

  /// A frame begins at `now`, s. silence_time: of the server, s. False if the world does not make
  /// up for the time since the frame before.
  bool begin_frame(double now, double silence_time) noexcept;
  /// Time from the frame before to the latest, s; a period in the first.
  double passed() const noexcept { return passed_; }
  /// How many steps of `step` seconds, > 0, must be taken in it; may be 0. The rest is left for the
  /// next. reported: time from what the bodies got of the hand's impulses to the latest report of
  /// them, s.
  int take_steps(double step, double reported) noexcept;
  /// The engine has taken steps of `period` seconds together.
  void end_steps(double now, double period) noexcept;

 private:
  double period_;
  bool begun_ = false;   ///< There was a frame before.
  double begun_at_ = 0;  ///< s.
  double passed_ = 0;
  double stepped_at_ = 0;  ///< Begin of the latest frame with steps, s.
  double owed_ = 0;        ///< s.
  int slow_ = 0;  ///< Frames whose steps took longer than they simulate, one after another.
};

}  // namespace hlm
