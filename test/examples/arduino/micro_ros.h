// Declarations of micro_ros_arduino (humble), of those that examples/esp32_driver uses.

#ifndef MICRO_ROS_H_
#define MICRO_ROS_H_

#include "Arduino.h"

typedef int32_t rcl_ret_t;
typedef int32_t rmw_ret_t;
#define RCL_RET_OK 0
#define RMW_RET_OK 0
#define RCL_MS_TO_NS(milliseconds) ((milliseconds) * 1000LL * 1000LL)

struct rosidl_runtime_c__String {
  char *data;
  size_t size, capacity;
};
struct rosidl_runtime_c__String__Sequence {
  rosidl_runtime_c__String *data;
  size_t size, capacity;
};
struct rosidl_runtime_c__double__Sequence {
  double *data;
  size_t size, capacity;
};
struct builtin_interfaces__msg__Time {
  int32_t sec;
  uint32_t nanosec;
};
struct std_msgs__msg__Header {
  builtin_interfaces__msg__Time stamp;
  rosidl_runtime_c__String frame_id;
};
struct sensor_msgs__msg__JointState {
  std_msgs__msg__Header header;
  rosidl_runtime_c__String__Sequence name;
  rosidl_runtime_c__double__Sequence position, velocity, effort;
};

struct rosidl_message_type_support_t;
const rosidl_message_type_support_t *joint_state_type();
#define ROSIDL_GET_MSG_TYPE_SUPPORT(package, kind, name) joint_state_type()

struct rcl_allocator_t {
  void *state;
};
struct rcl_context_t {
  void *impl;
};
struct rmw_context_t;
struct rcl_node_t {
  void *impl;
};
struct rcl_publisher_t {
  void *impl;
};
struct rcl_subscription_t {
  void *impl;
};
struct rmw_publisher_allocation_t;
struct rclc_support_t {
  rcl_context_t context;
};
struct rclc_executor_t {
  size_t max_handles;
};
enum rclc_executor_handle_invocation_t { ON_NEW_DATA, ALWAYS };
typedef void (*rclc_subscription_callback_t)(const void *);

rcl_allocator_t rcl_get_default_allocator();
rmw_context_t *rcl_context_get_rmw_context(rcl_context_t *context);
rcl_ret_t rcl_publish(const rcl_publisher_t *publisher, const void *message,
                      rmw_publisher_allocation_t *allocation);
rcl_ret_t rcl_publisher_fini(rcl_publisher_t *publisher, rcl_node_t *node);
rcl_ret_t rcl_subscription_fini(rcl_subscription_t *subscription, rcl_node_t *node);
rcl_ret_t rcl_node_fini(rcl_node_t *node);
rcl_ret_t rclc_support_init(rclc_support_t *support, int argc, char const *const *argv,
                            rcl_allocator_t *allocator);
rcl_ret_t rclc_support_fini(rclc_support_t *support);
rcl_ret_t rclc_node_init_default(rcl_node_t *node, const char *name, const char *space,
                                 rclc_support_t *support);
rcl_ret_t rclc_publisher_init_best_effort(rcl_publisher_t *publisher, const rcl_node_t *node,
                                          const rosidl_message_type_support_t *type,
                                          const char *topic);
rcl_ret_t rclc_subscription_init_best_effort(rcl_subscription_t *subscription, rcl_node_t *node,
                                             const rosidl_message_type_support_t *type,
                                             const char *topic);
rclc_executor_t rclc_executor_get_zero_initialized_executor();
rcl_ret_t rclc_executor_init(rclc_executor_t *executor, rcl_context_t *context, size_t handles,
                             const rcl_allocator_t *allocator);
rcl_ret_t rclc_executor_add_subscription(rclc_executor_t *executor,
                                         rcl_subscription_t *subscription, void *message,
                                         rclc_subscription_callback_t callback,
                                         rclc_executor_handle_invocation_t invocation);
rcl_ret_t rclc_executor_spin_some(rclc_executor_t *executor, const uint64_t timeout);
rcl_ret_t rclc_executor_fini(rclc_executor_t *executor);

rmw_ret_t rmw_uros_ping_agent(const int timeout, const uint8_t attempts);
rmw_ret_t rmw_uros_sync_session(const int timeout);
int64_t rmw_uros_epoch_nanos();
rmw_ret_t rmw_uros_set_context_entity_destroy_session_timeout(rmw_context_t *context, int timeout);
void set_microros_wifi_transports(char *network, char *password, char *agent, uint port);

struct micro_ros_utilities_memory_conf_t {
  size_t max_string_capacity, max_ros2_type_sequence_capacity, max_basic_type_sequence_capacity;
  const void *rules;
  size_t n_rules;
  const void *allocator;
};
static const micro_ros_utilities_memory_conf_t micro_ros_utilities_memory_conf_default = {
    20, 5, 5, nullptr, 0, nullptr};
bool micro_ros_utilities_create_message_memory(const rosidl_message_type_support_t *type,
                                               void *message,
                                               micro_ros_utilities_memory_conf_t sizes);
rosidl_runtime_c__String micro_ros_string_utilities_set(const rosidl_runtime_c__String text,
                                                        const char *content);

#endif  // MICRO_ROS_H_
