// crank_command and crank_state of ROS 2 over Wi-Fi, by a micro-ROS agent.
//
// The serial transport of micro_ros_arduino has 115200 baud, too few for 100 messages a second.

#include <micro_ros_arduino.h>
#include <micro_ros_utilities/string_utilities.h>
#include <micro_ros_utilities/type_utilities.h>
#include <rcl/rcl.h>
#include <rclc/executor.h>
#include <rclc/rclc.h>
#include <rmw_microros/rmw_microros.h>
#include <sensor_msgs/msg/joint_state.h>

char kNetwork[] = "network";
char kPassword[] = "password";
char kAgent[] = "192.168.1.2";
const uint kAgentPort = 8888;
const char *const kJoints[kMotors] = {"left_crank", "right_crank"};
// Periods of crank_state, and of the search for the agent [ms].
const uint32_t kStatePeriod = 10;
const uint32_t kSearchPeriod = 500;
// Period of the synchronisation with the clock of the agent, and its timeout [ms].
const uint32_t kSyncPeriod = 60000;
const int kSyncTimeout = 200;
// An older command is none [ns].
const int64_t kMaxAge = 500000000;

rclc_support_t support;
rcl_node_t node;
rcl_publisher_t publisher;
rcl_subscription_t subscription;
rclc_executor_t executor;
rcl_allocator_t allocator;
sensor_msgs__msg__JointState command;
sensor_msgs__msg__JointState state;
bool is_connected = false;
uint32_t state_sent = 0;
uint32_t searched = 0;
uint32_t synchronised = 0;

void on_command(const void *message) {
  const auto *given = static_cast<const sensor_msgs__msg__JointState *>(message);
  if (given->name.size != given->velocity.size) {
    return;
  }
  const auto &stamp = given->header.stamp;
  const int64_t sent = 1000000000LL * stamp.sec + stamp.nanosec;
  const int64_t age = rmw_uros_epoch_nanos() - sent;
  if (sent != 0 && (age > kMaxAge || age < -kMaxAge)) {
    return;
  }
  for (int i = 0; i < kMotors; i++) {
    for (size_t k = 0; k < given->name.size; k++) {
      if (strcmp(given->name.data[k].data, kJoints[i]) == 0) {
        command_motor(i, static_cast<float>(given->velocity.data[k]));
      }
    }
  }
}

bool create_message(sensor_msgs__msg__JointState *message) {
  micro_ros_utilities_memory_conf_t sizes = micro_ros_utilities_memory_conf_default;
  sizes.max_string_capacity = 32;
  sizes.max_ros2_type_sequence_capacity = 8;
  sizes.max_basic_type_sequence_capacity = 8;
  return micro_ros_utilities_create_message_memory(
      ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), message, sizes);
}

bool create_entities() {
  const auto *type = ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState);
  allocator = rcl_get_default_allocator();
  executor = rclc_executor_get_zero_initialized_executor();
  return rclc_support_init(&support, 0, nullptr, &allocator) == RCL_RET_OK &&
         rclc_node_init_default(&node, "motor_board", "", &support) == RCL_RET_OK &&
         rclc_publisher_init_best_effort(&publisher, &node, type, "crank_state") == RCL_RET_OK &&
         rclc_subscription_init_best_effort(&subscription, &node, type, "crank_command") ==
             RCL_RET_OK &&
         rclc_executor_init(&executor, &support.context, 1, &allocator) == RCL_RET_OK &&
         rclc_executor_add_subscription(&executor, &subscription, &command, on_command,
                                        ON_NEW_DATA) == RCL_RET_OK &&
         rmw_uros_sync_session(kSyncTimeout) == RMW_RET_OK;
}

void destroy_entities() {
  rmw_context_t *context = rcl_context_get_rmw_context(&support.context);
  (void)rmw_uros_set_context_entity_destroy_session_timeout(context, 0);
  (void)rcl_publisher_fini(&publisher, &node);
  (void)rcl_subscription_fini(&subscription, &node);
  (void)rclc_executor_fini(&executor);
  (void)rcl_node_fini(&node);
  (void)rclc_support_fini(&support);
}

void publish_state() {
  double angles[kMotors];
  const uint32_t measured = measured_angles(angles);
  const int64_t age = 1000LL * static_cast<uint32_t>(micros() - measured);
  const int64_t stamp = rmw_uros_epoch_nanos() - age;
  state.header.stamp.sec = static_cast<int32_t>(stamp / 1000000000LL);
  state.header.stamp.nanosec = static_cast<uint32_t>(stamp % 1000000000LL);
  for (int i = 0; i < kMotors; i++) {
    state.position.data[i] = angles[i];
  }
  (void)rcl_publish(&publisher, &state, nullptr);
}

void link_setup() {
  set_microros_wifi_transports(kNetwork, kPassword, kAgent, kAgentPort);
  while (!create_message(&command) || !create_message(&state)) {
    delay(1000);
  }
  for (int i = 0; i < kMotors; i++) {
    state.name.data[i] = micro_ros_string_utilities_set(state.name.data[i], kJoints[i]);
  }
  state.name.size = kMotors;
  state.position.size = kMotors;
}

void link_loop() {
  if (millis() - searched >= kSearchPeriod) {
    searched = millis();
    const bool is_there = rmw_uros_ping_agent(100, 3) == RMW_RET_OK;
    if (is_there && !is_connected) {
      is_connected = create_entities();
      if (!is_connected) {
        destroy_entities();
      }
    }
    if (is_connected && !is_there) {
      is_connected = false;
      destroy_entities();
    }
  }
  if (!is_connected) {
    delay(10);
    return;
  }
  if (millis() - synchronised >= kSyncPeriod) {
    synchronised = millis();
    (void)rmw_uros_sync_session(kSyncTimeout);
  }
  (void)rclc_executor_spin_some(&executor, RCL_MS_TO_NS(2));
  if (millis() - state_sent >= kStatePeriod) {
    state_sent = millis();
    publish_state();
  }
}
