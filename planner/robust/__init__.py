"""Plans that bear an uncertain opening: quiet releases, scenarios, constant rates."""

from .hardening import QUIET_MESH, Hardening, hardened, robust_scene
