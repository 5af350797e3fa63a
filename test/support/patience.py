"""How long a test waits for what comes at once where the machine is not busy."""

import os

# Timeout [s]; scripts/test measures how many times slower than usual the machine is.
PATIENCE = 60.0 * float(os.environ.get('KLANN_ROS_SLOWNESS', '1'))
