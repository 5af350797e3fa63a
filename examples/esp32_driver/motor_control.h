// The control of one motor: counts of its encoder in, duty of its bridge out.
//
// Plain C++11 without Arduino and ROS: test/examples/test_motor_control.py compiles and tests it.
// Rates and angles are those of the shaft whose turn has counts_per_turn counts, in rad and s.

#ifndef MOTOR_CONTROL_H_
#define MOTOR_CONTROL_H_

#include <math.h>
#include <stdint.h>

struct MotorConfig {
  // Counts of the encoder in one turn of the shaft; negative if it counts against the turn.
  float counts_per_turn;
  // Rate of the shaft at full voltage [rad/s]; negative if the leads are swapped.
  float full_rate;
  // A greater command is limited [rad/s].
  float max_rate;
  // Gains of the rate loop: duty by error [s/rad], and by its integral [1/rad].
  float proportional_gain;
  float integral_gain;
  // Without a younger command the bridge is switched off [s].
  float command_timeout;
};

// Change of a quadrature encoder's count between two states of its lines, (A << 1) | B. The
// sequence 0, 1, 3, 2 counts up; an impossible step of two counts as none.
inline int8_t quadrature_step(uint8_t before, uint8_t after) {
  static const int8_t kSteps[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};
  return kSteps[((before & 3) << 2) | (after & 3)];
}

class MotorControl {
 public:
  explicit MotorControl(const MotorConfig &config) : config_(config) {}

  // Take a command [rad/s] at a time of micros(), which wraps. One that is not finite is none.
  void command(float rate, uint32_t now) {
    if (!isfinite(rate)) {
      return;
    }
    target_ = fmaxf(-config_.max_rate, fminf(rate, config_.max_rate));
    commanded_ = now;
    is_commanded_ = true;
  }

  // Return the duty, -1 to 1, for the encoder's counter, which wraps, at a time of micros().
  float update(int32_t counter, uint32_t now) {
    if (!has_counter_) {
      has_counter_ = true;
      counter_ = counter;
      updated_ = now;
    }
    const float dt = 1e-6f * static_cast<float>(static_cast<uint32_t>(now - updated_));
    // The difference of unsigned numbers is right over a wrap of the counter.
    const uint32_t step = static_cast<uint32_t>(counter) - static_cast<uint32_t>(counter_);
    const int32_t counts = static_cast<int32_t>(step);
    counts_ += counts;
    counter_ = counter;
    updated_ = now;
    if (dt > 0.0f) {
      rate_ = radians(counts) / dt;
    }
    // The command stays expired: the clock wraps after 72 minutes, and would make it young again.
    if (is_commanded_ && static_cast<uint32_t>(now - commanded_) > timeout()) {
      is_commanded_ = false;
    }
    // Off, and not controlled to zero: with a reversed or frozen encoder this would drive it.
    if (!is_commanded_ || target_ == 0.0f) {
      integral_ = 0.0f;
      return 0.0f;
    }
    return rate_duty(dt);
  }

  // Angle of the shaft since the first update [rad], and its mean rate over the last period.
  double angle() const { return kTurn * static_cast<double>(counts_) / config_.counts_per_turn; }
  float rate() const { return rate_; }
  // Time of the last update [us].
  uint32_t updated() const { return updated_; }
  bool is_commanded() const { return is_commanded_; }

 private:
  static constexpr double kTurn = 6.283185307179586;

  float radians(int32_t counts) const {
    return static_cast<float>(kTurn) * static_cast<float>(counts) / config_.counts_per_turn;
  }

  uint32_t timeout() const { return static_cast<uint32_t>(1e6f * config_.command_timeout); }

  // Feed-forward of the no-load rate, with a PI controller of the error.
  float rate_duty(float dt) {
    const float error = target_ - rate_;
    const float integral = integral_ + config_.integral_gain * error * dt;
    const float feed_forward = target_ / fabsf(config_.full_rate);
    const float duty = feed_forward + config_.proportional_gain * error + integral;
    const float limited = fmaxf(-1.0f, fminf(duty, 1.0f));
    // No windup: at the limit the integral may only shrink.
    if (duty == limited || error * duty < 0.0f) {
      integral_ = integral;
    }
    return config_.full_rate < 0.0f ? -limited : limited;
  }

  MotorConfig config_;
  // Commanded rate [rad/s], its arrival [us], and whether it is young enough.
  float target_ = 0.0f;
  uint32_t commanded_ = 0;
  bool is_commanded_ = false;
  // Last counter of the encoder, its time [us], and the counts since the first one.
  int32_t counter_ = 0;
  uint32_t updated_ = 0;
  bool has_counter_ = false;
  int64_t counts_ = 0;
  // Measured rate [rad/s], and integral of the controller [duty].
  float rate_ = 0.0f;
  float integral_ = 0.0f;
};

#endif  // MOTOR_CONTROL_H_
