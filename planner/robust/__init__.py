"""Plans that bear an uncertain opening: quiet releases, scenarios, constant rates."""

from .hardening import Hardened, Hardening
