"""
What of launch 3.4.0 and launch_ros 0.26.4 the launch files may use; Jazzy has these or newer ones.

For each name the keyword arguments that it takes there, read in its source. What is not here may
be newer: look for it in the tag 3.4.0 before adding it.
"""

ACTION = {'condition'}
PROCESS = ACTION | {
    *('additional_env', 'cached_output', 'cwd', 'emulate_tty', 'env', 'log_cmd', 'name'),
    *('on_exit', 'output', 'output_format', 'prefix', 'respawn', 'respawn_delay'),
    *('respawn_max_retries', 'shell', 'sigkill_timeout', 'sigterm_timeout'),
}
NAMES: dict[str, dict[str, set[str]]] = {
    'ament_index_python.packages': {'PackageNotFoundError': set(), 'get_package_prefix': set()},
    'launch': {'LaunchContext': set(), 'LaunchDescription': {'deprecated_reason'}},
    'launch.actions': {
        'DeclareLaunchArgument': ACTION | {'choices', 'default_value', 'description'},
        'ExecuteProcess': PROCESS | {'cmd', 'shell'},
        'IncludeLaunchDescription': ACTION | {'launch_arguments'},
        'LogInfo': ACTION | {'msg'},
        'OpaqueFunction': ACTION | {'args', 'function', 'kwargs'},
        'RegisterEventHandler': ACTION,
        'Shutdown': ACTION | {'reason'},
    },
    'launch.conditions': {'IfCondition': set(), 'UnlessCondition': set()},
    'launch.event_handlers': {
        'OnProcessExit': {'handle_once', 'on_exit', 'target_action'},
        'OnShutdown': {'on_shutdown'},
    },
    'launch.events': {'Shutdown': {'due_to_sigint', 'reason'}},
    'launch.events.process': {'ProcessExited': {'returncode'}},
    'launch.launch_description_sources': {'PythonLaunchDescriptionSource': set()},
    'launch.substitutions': {
        'EqualsSubstitution': set(),
        'LaunchConfiguration': {'default'},
        'PathJoinSubstitution': set(),
        'SubstitutionFailure': set(),
    },
    'launch_ros.actions': {
        'Node': PROCESS
        | {
            *('arguments', 'exec_name', 'executable', 'namespace', 'package', 'parameters'),
            *('remappings', 'ros_arguments'),
        }
    },
    'launch_ros.parameter_descriptions': {'ParameterValue': {'value_type'}},
    'launch_ros.substitutions': {
        'ExecutableInPackage': {'executable', 'package'},
        'FindPackageShare': set(),
    },
}
# These take a list of texts and substitutions; a list in it came with a later launch.
FLAT = ('FindPackageShare', 'LaunchConfiguration', 'PathJoinSubstitution')
