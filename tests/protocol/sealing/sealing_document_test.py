"""Checks the vector of PROTOCOL.md's section on sealing against that section's own steps.

The steps are carried out here from the document alone, with hashlib and the cryptography package. The C++
tests compare the same bytes with the implementation. With --write the bytes are written into the document.
"""

import hashlib
import hmac
import pathlib
import re
import struct
import sys

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
import document_test

NAME = b"Noise_NNpsk0_25519_ChaChaPoly_BLAKE2b"
PROLOGUE = b"haptic local model, sealing 1"
PACKETS = {"hello": ("client", 0), "welcome": ("server", 0), "goodbye": ("client", 2**32)}
INITIATION, RESPONSE, SEALED = 1, 2, 3


def digest(data):
    return hashlib.blake2b(data, digest_size=64).digest()


def hkdf(chaining_key, material, count):
    key = hmac.new(chaining_key, material, hashlib.blake2b).digest()
    outputs = [b""]
    for number in range(1, count + 1):
        outputs.append(hmac.new(key, outputs[-1] + bytes([number]), hashlib.blake2b).digest())
    return outputs[1:]


def cipher(key, number):
    return ChaCha20Poly1305(key), bytes(4) + struct.pack("<Q", number)


def seal(key, number, text, data=b""):
    aead, nonce = cipher(key, number)
    return aead.encrypt(nonce, text, data)


def opens(key, number, sealed):
    aead, nonce = cipher(key, number)
    try:
        aead.decrypt(nonce, sealed, b"")
        return True
    except InvalidTag:
        return False


class Handshake:
    """What both sides compute."""

    def __init__(self, key, prologue=PROLOGUE):
        self.hash = self.chaining_key = NAME.ljust(64, b"\0")
        self.mix(prologue)
        self.chaining_key, mixed, k = hkdf(self.chaining_key, key, 3)
        self.mix(mixed)
        self.key = k[:32]

    def mix(self, data):
        self.hash = digest(self.hash + data)

    def mix_key(self, material):
        self.chaining_key, k = hkdf(self.chaining_key, material, 2)
        self.key = k[:32]

    def message(self, secret, payload, others=None):
        """The first message, or with the other side's public key the second."""
        own = X25519PrivateKey.from_private_bytes(secret)
        public = own.public_key().public_bytes(Encoding.Raw, PublicFormat.Raw)
        self.mix(public)
        self.mix_key(public)
        if others is not None:
            self.mix_key(own.exchange(X25519PublicKey.from_public_bytes(others)))
        sealed = seal(self.key, 0, payload, self.hash)
        self.mix(sealed)
        return public + sealed


def vector(values, examples):
    """The computed values of the document's vector, from the given ones."""
    given = {name: bytes.fromhex(text) for name, text in values.items()}
    handshake = Handshake(given["key"])
    first = handshake.message(given["client_secret"], given["client_index"])
    second = handshake.message(given["server_secret"], given["server_index"], first[:32])
    keys = [output[:32] for output in hkdf(handshake.chaining_key, b"", 2)]
    magic = b"HLS"
    computed = {
        "initiation": magic + bytes([INITIATION]) + first,
        "response": magic + bytes([RESPONSE]) + given["client_index"] + second,
        "client_seals_with": keys[0],
        "server_seals_with": keys[1],
    }
    for name, (sender, counter) in PACKETS.items():
        key, receiver = (keys[0], "server_index") if sender == "client" else (keys[1], "client_index")
        header = magic + bytes([SEALED]) + given[receiver] + struct.pack("<Q", counter)
        computed[name] = header + seal(key, counter, examples[name])
        if opens(keys[1 - keys.index(key)], counter, computed[name][16:]):
            sys.exit("the two directions must not have one key")
    return computed


def main():
    path = sys.argv[-1]
    document = open(path, encoding="utf-8").read()
    if f"`{NAME.decode()}`" not in document or f"{len(PROLOGUE)} bytes `{PROLOGUE.decode()}`" not in document:
        sys.exit("the document must name the handshake and its prologue")
    examples = {name: bytes.fromhex(data) for name, _, data in document_test.read_examples(document)}
    block = re.search(r"^### Vector: sealing\n.*?```values\n(.*?)```", document, flags=re.M | re.S)
    values = dict(line.split(" = ", 1) for line in block.group(1).splitlines())
    computed = vector(values, examples)
    if sys.argv[1] == "--write":
        values.update({name: data.hex() for name, data in computed.items()})
        text = "".join(f"{name} = {value}\n" for name, value in values.items())
        document = document[: block.start(1)] + text + document[block.end(1) :]
        open(path, "w", encoding="utf-8").write(document)
    else:
        for name, data in computed.items():
            if values[name] != data.hex():
                sys.exit(f"{name}: the steps give\n{data.hex()}\nbut the vector says\n{values[name]}")
    print(f"{len(computed)} values of the vector agree with the steps")


if __name__ == "__main__":
    main()
