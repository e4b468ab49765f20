"""`python3 -m haptic`: the contrast in a browser; see haptic.demo."""

import sys

from haptic.demo import main

sys.exit(main())
