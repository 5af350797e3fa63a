// What motor_board.py calls of examples/esp32_driver, with the names of C.

#include "line_protocol.h"
#include "motor_control.h"

extern "C" {

MotorControl *motor_new(float counts_per_turn, float full_rate, float max_rate, float proportional,
                        float integral, float timeout) {
  return new MotorControl(
      {counts_per_turn, full_rate, max_rate, proportional, integral, timeout});
}

void motor_command(MotorControl *motor, float rate, uint32_t now) { motor->command(rate, now); }

float motor_update(MotorControl *motor, int32_t counter, uint32_t now) {
  return motor->update(counter, now);
}

double motor_angle(const MotorControl *motor) { return motor->angle(); }

float motor_rate(const MotorControl *motor) { return motor->rate(); }

int quadrature(uint8_t before, uint8_t after) { return quadrature_step(before, after); }

LineReader *reader_new() { return new LineReader(); }

const char *reader_take(LineReader *reader, char byte) { return reader->take(byte); }

int rates_of(const char *line, float *rates, int count) { return read_rates(line, rates, count); }

int angles_line(char *line, int size, uint32_t now, const double *angles, int count) {
  return write_angles(line, size, now, angles, count);
}
}
