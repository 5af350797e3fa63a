// A motor board for walker_node on an ESP32: encoders, bridges, rate loops, and their watchdog.
//
// docs/hardware.md explains it. Without USE_MICRO_ROS the board speaks lines over USB with
// examples/hardware_driver; with it, ROS 2 over Wi-Fi (library micro_ros_arduino).
// Try it with the legs in the air. Nothing in here replaces an emergency stop.

#define USE_MICRO_ROS 0

#include <esp_task_wdt.h>

#include "motor_control.h"

const int kMotors = 2;

// Wiring of a motor: the two inputs of its bridge, and the two lines of its encoder.
struct MotorPins {
  uint8_t forward;
  uint8_t backward;
  uint8_t a;
  uint8_t b;
};

const MotorPins kPins[kMotors] = {{25, 26, 34, 35}, {27, 14, 36, 39}};
// Counts in a turn, full rate [rad/s], greatest rate, gains, command timeout [s]. Four counts a
// line: 64 counts of the motor and a gear of 131.
const MotorConfig kConfigs[kMotors] = {
    {8384.0f, 8.0f, 3.0f, 0.1f, 0.5f, 0.5f},
    {-8384.0f, -8.0f, 3.0f, 0.1f, 0.5f, 0.5f},
};
// Period of the rate loops [ms]; frequency [Hz] and resolution [bits] of the PWM.
const uint32_t kPeriod = 5;
const uint32_t kPwmFrequency = 20000;
const uint8_t kPwmBits = 10;

MotorControl motors[kMotors] = {MotorControl(kConfigs[0]), MotorControl(kConfigs[1])};
// Counts of the encoders, and the last states of their lines.
volatile int32_t counters[kMotors] = {0, 0};
volatile uint8_t lines[kMotors] = {0, 0};
// Protects `motors`: the rate loops run on the other core.
portMUX_TYPE motors_lock = portMUX_INITIALIZER_UNLOCKED;

// What the two links use.

void command_motor(int index, float rate) {
  portENTER_CRITICAL(&motors_lock);
  motors[index].command(rate, micros());
  portEXIT_CRITICAL(&motors_lock);
}

// Return the time of the measurement [us], and the angles [rad].
uint32_t measured_angles(double *angles) {
  portENTER_CRITICAL(&motors_lock);
  for (int i = 0; i < kMotors; i++) {
    angles[i] = motors[i].angle();
  }
  const uint32_t measured = motors[0].updated();
  portEXIT_CRITICAL(&motors_lock);
  return measured;
}

#if USE_MICRO_ROS
#include "micro_ros_link.h"
#else
#include "serial_link.h"
#endif

void IRAM_ATTR on_encoder(void *argument) {
  const int index = static_cast<int>(reinterpret_cast<intptr_t>(argument));
  const uint8_t state = (digitalRead(kPins[index].a) << 1) | digitalRead(kPins[index].b);
  counters[index] = counters[index] + quadrature_step(lines[index], state);
  lines[index] = state;
}

void attach_pwm(uint8_t pin, uint8_t channel) {
#if ESP_ARDUINO_VERSION_MAJOR >= 3
  (void)channel;
  ledcAttach(pin, kPwmFrequency, kPwmBits);
#else
  ledcSetup(channel, kPwmFrequency, kPwmBits);
  ledcAttachPin(pin, channel);
#endif
}

void write_pwm(uint8_t pin, uint8_t channel, float duty) {
  const uint32_t level = static_cast<uint32_t>(fmaxf(0.0f, duty) * ((1 << kPwmBits) - 1));
#if ESP_ARDUINO_VERSION_MAJOR >= 3
  (void)channel;
  ledcWrite(pin, level);
#else
  (void)pin;
  ledcWrite(channel, level);
#endif
}

// With both inputs low the bridge is off.
void write_bridge(int index, float duty) {
  write_pwm(kPins[index].forward, 2 * index, duty);
  write_pwm(kPins[index].backward, 2 * index + 1, -duty);
}

// The rate loops: no link can hold them up. If they hang, the task watchdog resets the board.
void control_task(void *) {
  esp_task_wdt_add(nullptr);
  TickType_t woken = xTaskGetTickCount();
  while (true) {
    for (int i = 0; i < kMotors; i++) {
      portENTER_CRITICAL(&motors_lock);
      const float duty = motors[i].update(counters[i], micros());
      portEXIT_CRITICAL(&motors_lock);
      write_bridge(i, duty);
    }
    esp_task_wdt_reset();
    vTaskDelayUntil(&woken, pdMS_TO_TICKS(kPeriod));
  }
}

void setup() {
  for (int i = 0; i < kMotors; i++) {
    attach_pwm(kPins[i].forward, 2 * i);
    attach_pwm(kPins[i].backward, 2 * i + 1);
    write_bridge(i, 0.0f);
    pinMode(kPins[i].a, INPUT);
    pinMode(kPins[i].b, INPUT);
    void *argument = reinterpret_cast<void *>(static_cast<intptr_t>(i));
    attachInterruptArg(digitalPinToInterrupt(kPins[i].a), on_encoder, argument, CHANGE);
    attachInterruptArg(digitalPinToInterrupt(kPins[i].b), on_encoder, argument, CHANGE);
  }
  xTaskCreatePinnedToCore(control_task, "control", 4096, nullptr, 20, nullptr, 0);
  link_setup();
}

void loop() { link_loop(); }
