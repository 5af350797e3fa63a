"""
Publishers that no ROS client would make, on real DDS: any name of a topic, any name of its type.

The middleware's own function is called, below the checks of rcl and rclpy, as whatever else is on
a network does. Only Fast DDS is known here.
"""

import ctypes
from ctypes import c_bool, c_char_p, c_int, c_size_t, c_uint64, c_void_p
from typing import Any, ClassVar

from rclpy.node import Node
from rclpy.type_support import check_is_valid_msg_type
from std_msgs.msg import Float64

_TIME = c_uint64 * 2
_CALLBACKS = 7
FAST = b'rosidl_typesupport_fastrtps_c'
_FIND = ctypes.CFUNCTYPE(c_void_p, c_void_p, c_char_p)


class _Support(ctypes.Structure):
    """`rosidl_message_type_support_t`."""

    _fields_: ClassVar[list[Any]] = [
        ('identifier', c_char_p),
        ('data', c_void_p),
        ('find', _FIND),
        ('hash', c_void_p),
        ('description', c_void_p),
        ('sources', c_void_p),
    ]


class _Qos(ctypes.Structure):
    """`rmw_qos_profile_t`."""

    _fields_: ClassVar[list[Any]] = [
        ('history', c_int),
        ('depth', c_size_t),
        ('reliability', c_int),
        ('durability', c_int),
        ('deadline', _TIME),
        ('lifespan', _TIME),
        ('liveliness', c_int),
        ('liveliness_lease_duration', _TIME),
        ('avoid_ros_namespace_conventions', c_bool),
    ]


class _Options(ctypes.Structure):
    """`rmw_publisher_options_t`."""

    _fields_: ClassVar[list[Any]] = [('payload', c_void_p), ('unique_flow', c_int)]


class Stranger:
    """
    A publisher of a name and a type that are just bytes; its messages are Float64's.

    Parameters
    ----------
    node : rclpy.node.Node
        In whose participant it is.
    topic : bytes
        The topic's name.
    kind : bytes
        The type's name, such as b'std_msgs/msg/Float64'.

    """

    def __init__(self, node: Node, topic: bytes, kind: bytes = b'std_msgs/msg/Float64') -> None:
        rcl, self._rmw = ctypes.CDLL('librcl.so'), ctypes.CDLL('librmw_fastrtps_cpp.so')
        rcl.rcl_node_get_rmw_handle.restype = c_void_p
        self._rmw.rmw_create_publisher.restype = c_void_p
        self._node = c_void_p(rcl.rcl_node_get_rmw_handle(c_void_p(node.handle.pointer)))
        support = self._type_support(kind)
        # Keep last 10, reliable, volatile, automatic; ROS's own prefix of a topic is written out.
        qos = _Qos(1, 10, 1, 2, _TIME(), _TIME(), 1, _TIME(), True)
        made = self._rmw.rmw_create_publisher(
            self._node,
            support,
            c_char_p(b'rt' + topic),
            ctypes.byref(qos),
            ctypes.byref(_Options()),
        )
        assert made, 'the middleware refuses it'
        self._publisher = c_void_p(made)

    def close(self) -> None:
        self._rmw.rmw_destroy_publisher(self._node, self._publisher)

    def _type_support(self, kind: bytes) -> Any:
        """Return the support of Float64, which calls itself another type where DDS is told."""
        check_is_valid_msg_type(Float64)
        pointer = ctypes.pythonapi.PyCapsule_GetPointer
        pointer.restype, pointer.argtypes = c_void_p, [ctypes.py_object, c_char_p]
        known = pointer(Float64.__class__._TYPE_SUPPORT, None)
        general = _Support.from_address(known)
        fast = _Support.from_address(general.find(known, FAST))
        callbacks = (c_void_p * _CALLBACKS).from_address(fast.data)
        space, _, name = kind.rpartition(b'/')
        # All of this is read as long as there is the publisher.
        self._texts = [ctypes.create_string_buffer(t) for t in (space.replace(b'/', b'::'), name)]
        places = [ctypes.addressof(text) for text in self._texts]
        self._callbacks = (c_void_p * _CALLBACKS)(*places, *callbacks[2:])
        own = _Support.from_buffer_copy(fast)
        own.data = ctypes.addressof(self._callbacks)

        def find(_: int, identifier: bytes) -> int:
            return ctypes.addressof(own) if identifier == FAST else general.find(known, identifier)

        self._own, self._find = own, _FIND(find)
        self._support = _Support.from_buffer_copy(general)
        self._support.find = self._find
        return ctypes.byref(self._support)
