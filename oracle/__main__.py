"""`.venv/bin/python -m oracle sweeps 60` or `corners 100`: prints the counts."""

from __future__ import annotations

import sys
from collections import Counter

from .studies import SCENES, corner_contacts, sweep_counts

if __name__ == "__main__":
    study, count = sys.argv[1], int(sys.argv[2])
    if study == "sweeps":
        for row in sweep_counts(count, 200):
            print(*row.values(), flush=True)
    else:
        for arm in SCENES:
            found = list(corner_contacts(arm, count))
            deep = [1e3 * depth for _, depth in found if depth > 0.0]
            print(arm, dict(Counter(said for said, _ in found)), "contacts [mm]:", deep, flush=True)
