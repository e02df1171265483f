"""Many picks and bins as one motion: joints of hand poses, the same jobs by placing."""

from .inverse_kinematics import inverse_kinematics
