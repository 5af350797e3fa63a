"""What a leg is to the nodes: a Klann leg, or any linkage."""

from klann_ros.kinematics import (
    KlannLeg,
    KlannPose,
    KlannVelocity,
    LinkageLeg,
    LinkageMotion,
    LinkagePose,
)

Leg = KlannLeg | LinkageLeg
LegPose = KlannPose | LinkagePose
LegVelocity = KlannVelocity | LinkageMotion
