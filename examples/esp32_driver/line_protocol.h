// The line protocol of examples/hardware_driver/serial_motors.py, in plain C++11.
//
//   R 0.500 -0.500*3B            to the board: rates of the shafts [rad/s]
//   S 1234567 0.1250 3.1416*02   from the board: micros(), angles of the shafts [rad]
//
// The two digits are the exclusive or of all bytes before the star, as in NMEA 0183.

#ifndef LINE_PROTOCOL_H_
#define LINE_PROTOCOL_H_

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

inline uint8_t line_sum(const char *text, size_t length) {
  uint8_t sum = 0;
  for (size_t i = 0; i < length; i++) {
    sum ^= static_cast<uint8_t>(text[i]);
  }
  return sum;
}

// Read the rates of a line without its end; false if it is not a whole command of `count` motors.
inline bool read_rates(const char *line, float *rates, int count) {
  const char *star = strchr(line, '*');
  if (star == nullptr || strlen(star) != 3 || strncmp(line, "R ", 2) != 0) {
    return false;
  }
  char *end = nullptr;
  if (strtol(star + 1, &end, 16) != line_sum(line, star - line) || *end != '\0') {
    return false;
  }
  const char *position = line + 1;
  for (int i = 0; i < count; i++) {
    rates[i] = strtof(position, &end);
    if (end == position) {
      return false;
    }
    position = end;
  }
  return position == star;
}

// Write the line of a measurement, with its end; return its length, 0 if the buffer is too small.
inline int write_angles(char *line, int size, uint32_t now, const double *angles, int count) {
  int length = snprintf(line, size, "S %lu", static_cast<unsigned long>(now));
  for (int i = 0; i < count && length < size; i++) {
    length += snprintf(line + length, size - length, " %.5f", angles[i]);
  }
  if (length + 5 > size) {
    return 0;
  }
  const uint8_t sum = line_sum(line, length);
  return length + snprintf(line + length, size - length, "*%02X\n", sum);
}

// Collects the bytes of a port to lines.
class LineReader {
 public:
  // Take a byte; return the line that it ends, nullptr if there is none.
  const char *take(char byte) {
    if (byte == '\n' || byte == '\r') {
      const bool is_whole = length_ > 0 && length_ < kSize;
      line_[is_whole ? length_ : 0] = '\0';
      length_ = 0;
      return is_whole ? line_ : nullptr;
    }
    // A line that is too long is dropped as a whole.
    if (length_ < kSize) {
      line_[length_++] = byte;
    }
    return nullptr;
  }

 private:
  static const int kSize = 128;
  // Also room for the end of the text.
  char line_[kSize + 1] = {0};
  int length_ = 0;
};

#endif  // LINE_PROTOCOL_H_
