// How far a world advances in a frame, so that its time is the hand's.
#pragma once

namespace hlm {

/// The world makes up for a late frame as soon as the server has reported what the hand did
/// meanwhile: a carried body must fall for as long as it is carried. It does not make up for a
/// silence in which the server let go of the bodies, nor for what an engine loses that is slower
/// than its world: that would only make it later still. Altogether it makes up for no more than one
/// silence: frames in which no steps were asked for are a pause.
class WorldTime {
 public:
  /// period: nominal, of the frames, s, > 0.
  explicit WorldTime(double period) : period_(period) {}

  /// A frame begins at `now`, s. silence_time: the server's, s. False if the world does not make up
  /// for the time since the previous frame.
  bool begin_frame(double now, double silence_time) noexcept;
  /// Time from the previous frame to this one, s; one period in the first frame.
  double passed() const noexcept { return passed_; }
  /// How many steps of `step` seconds, > 0, this frame must take; may be 0. The rest is left for
  /// the next. reported: time between the impulses that the bodies have got and the latest that the
  /// server has reported, s.
  int take_steps(double step, double reported) noexcept;
  /// The engine has taken steps of `period` seconds in total.
  void end_steps(double now, double period) noexcept;

 private:
  double period_;
  bool begun_ = false;   ///< There has been a frame.
  double begun_at_ = 0;  ///< s.
  double passed_ = 0;
  double stepped_at_ = 0;  ///< When the latest frame with steps began, s.
  double owed_ = 0;        ///< s.
  int slow_ = 0;  ///< Frames whose steps took longer than they simulate, one after another.
};

}  // namespace hlm
