"""The page of a session as a frame in a notebook."""

from __future__ import annotations

import html
import secrets

# The page's cookie, which has a token, is for pages under its own name: the frame is asked for under the notebook's.
_FRAME = """<iframe id="{name}" src="{address}" width="100%" height="600" style="border: 0" title="Haptic local model"
  allow="fullscreen; gamepad"></iframe>
<script>{{
  const frame = document.getElementById("{name}");
  if (location.hostname === "localhost") frame.src = frame.src.replace("127.0.0.1", "localhost");
}}</script>"""


def frame_of(address: str) -> str:
    """HTML that shows the page at an address of this machine."""
    return _FRAME.format(name="haptic-" + secrets.token_hex(8), address=html.escape(address))
