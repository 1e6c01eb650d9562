"""Print what the validity monitor says beside the measured error: python tests/benchmarks/validity.py."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from validity_study import FAST, HEAD, HELD_BACK, SLOW, as_text, measure

if __name__ == "__main__":
    print(HEAD)
    wrong = 0
    for label, scene in {**FAST, **SLOW, **HELD_BACK}.items():
        for row in measure(label, scene()):
            print(as_text(row), flush=True)
            wrong += not row.right
    sys.exit(bool(wrong))
