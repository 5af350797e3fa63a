// Commands and angles as lines over USB: the other end is examples/hardware_driver.

#include "line_protocol.h"

// Period of the lines with angles [ms].
const uint32_t kLinePeriod = 10;

LineReader reader;
uint32_t line_sent = 0;

void link_setup() { Serial.begin(115200); }

void link_loop() {
  while (Serial.available() > 0) {
    const char *line = reader.take(static_cast<char>(Serial.read()));
    float rates[kMotors];
    if (line != nullptr && read_rates(line, rates, kMotors)) {
      for (int i = 0; i < kMotors; i++) {
        command_motor(i, rates[i]);
      }
    }
  }
  if (millis() - line_sent >= kLinePeriod) {
    line_sent = millis();
    double angles[kMotors];
    const uint32_t measured = measured_angles(angles);
    char line[96];
    const int length = write_angles(line, sizeof(line), measured, angles, kMotors);
    Serial.write(reinterpret_cast<const uint8_t *>(line), length);
  }
  delay(1);
}
