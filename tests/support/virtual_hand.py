"""A server in virtual time whose simulated device a scripted hand moves, for clients in this process."""

import haptic_local_model as haptic
from hand_session import GRIP


def server(hand, *options, **network):
    return haptic.virtual.Server(*options, hand=GRIP + hand, **network)


def active(server):
    """The ticks in which force was on."""
    ticks = server.ticks
    return ticks[ticks["server_state"] == "active"]


def play(hand, options, client):
    """The ticks with force on, and what client(server) returns."""
    with server(hand, *options) as running:
        result = client(running)
        return active(running), result
