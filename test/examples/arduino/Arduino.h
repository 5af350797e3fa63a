// Declarations of the ESP32's Arduino core 2 and 3, of those that examples/esp32_driver uses.

#ifndef ARDUINO_H_
#define ARDUINO_H_

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define IRAM_ATTR
#define INPUT 1
#define CHANGE 3
#define digitalPinToInterrupt(pin) (pin)

typedef unsigned int uint;

uint32_t micros();
uint32_t millis();
void delay(uint32_t milliseconds);
void pinMode(uint8_t pin, uint8_t mode);
int digitalRead(uint8_t pin);
void attachInterruptArg(uint8_t pin, void (*handler)(void *), void *argument, int mode);

#if ESP_ARDUINO_VERSION_MAJOR >= 3
bool ledcAttach(uint8_t pin, uint32_t frequency, uint8_t resolution);
bool ledcWrite(uint8_t pin, uint32_t duty);
#else
double ledcSetup(uint8_t channel, double frequency, uint8_t resolution);
void ledcAttachPin(uint8_t pin, uint8_t channel);
void ledcWrite(uint8_t channel, uint32_t duty);
#endif

struct HardwareSerial {
  void begin(unsigned long baud);
  int available();
  int read();
  size_t write(const uint8_t *buffer, size_t size);
};
extern HardwareSerial Serial;

// FreeRTOS.
typedef struct {
  uint32_t owner;
  uint32_t count;
} portMUX_TYPE;
#define portMUX_INITIALIZER_UNLOCKED {0, 0}
void portENTER_CRITICAL(portMUX_TYPE *lock);
void portEXIT_CRITICAL(portMUX_TYPE *lock);
typedef uint32_t TickType_t;
typedef int BaseType_t;
typedef unsigned int UBaseType_t;
typedef struct tskTaskControlBlock *TaskHandle_t;
#define pdMS_TO_TICKS(milliseconds) (static_cast<TickType_t>(milliseconds))
TickType_t xTaskGetTickCount();
void vTaskDelayUntil(TickType_t *previous, TickType_t period);
BaseType_t xTaskCreatePinnedToCore(void (*task)(void *), const char *name, uint32_t stack,
                                   void *argument, UBaseType_t priority, TaskHandle_t *handle,
                                   BaseType_t core);

// esp_task_wdt.h.
int esp_task_wdt_add(TaskHandle_t task);
int esp_task_wdt_reset();

#endif  // ARDUINO_H_
