"""What a leg is where any kind of it will do: a Klann leg, or any linkage."""

from .klann.leg import KlannLeg
from .klann.pose import KlannPose
from .klann.velocity import KlannVelocity
from .linkage.leg import LinkageLeg
from .linkage.motion import LinkageMotion
from .linkage.pose import LinkagePose

Leg = KlannLeg | LinkageLeg
LegPose = KlannPose | LinkagePose
LegVelocity = KlannVelocity | LinkageMotion
