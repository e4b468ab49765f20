"""`python3 -m haptic_local_model`: the contrast in a browser; see haptic.demo."""

import sys

from haptic_local_model.demo import main

sys.exit(main())
