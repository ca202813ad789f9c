"""The files of 0.1.0, which were copied by hand: an unmodified one is told by its SHA-256."""

# by name: every state that it had
CHECKSUMS: dict[str, frozenset[str]] = {
    "80-can0.network": frozenset({"52511aebc585e4693004ada455f0f0d1ea98b7a4cb2c2d9e293152a325154708"}),
    "80-vcan0.netdev": frozenset({"90d03a42c6886560554cf66eddceeda192b3c0f74dfe8b77a6f4464892c475ac"}),
    "80-vcan0.network": frozenset({"5f5d87b9c780328296c34830c6e3179a0decb04f8285c7190a3d1c79a8eb5200"}),
    "80-wrcd.conf": frozenset({"894e2bc3e8f45eab5ab6a79791285b7fcb8f02ad2f80a032066a28df2a7a3289"}),
    "sim-ecu@.service": frozenset({"33b6d9cd1b24e729ab1f93bac563a9a2f516e444de8dde49f13e9c7b9f1cca44"}),
    "wrcd@.service": frozenset(
        {
            "1ede7f572599fd02954c2ddbbcd54256c6c6ef46d8bb831e1b0c0842b9753bd9",
            "1fb39a9478af0c5632afb8cd9ac07b4db13fe9a539994e7b67480dd8fe774b52",
            "88dd226bc5ea63636c6e96e047d2334a59509e0818180a808420273da8f5f86a",
            "8dcdb99a9459e12fd32dbce914cdf4f8ebdba44585b5e5ad3e5e0b453b2d1fef",
            "9557f60a1654fc259fc4e0b2c1723c4c0993b09def5dee2b8d5b9be2244b0da0",
            "9dad8a9b7b8465f036b32beaf79ad2122e877e78368a5ff6cad6d5101a3a9b51",
            "d9c6071eb7011c07a94ea9e460de9c5a1ae3fd68729a00b4a360331e70d2b697",
            "e335fdae4efb491053a80e7bad34d0daa09577583c6661b0dab2a4e9b8bc1769",
        }
    ),
}
# Units are looked for there before any other folder: a copy hides what is installed.
UNITS = "etc/systemd/system"
# what each file was for: it stays asked for
GROUP_OF = {
    f"{UNITS}/sim-ecu@.service": "rig",
    "etc/systemd/network/80-can0.network": "can0",
    "etc/systemd/network/80-vcan0.netdev": "vcan0",
    "etc/systemd/network/80-vcan0.network": "vcan0",
}
BY_HAND = (f"{UNITS}/wrcd@.service", "etc/sysctl.d/80-wrcd.conf", *GROUP_OF)


def is_unmodified(path: str, checksum: str) -> bool:
    """Whether a file is as some state of 0.1.0 had it."""
    return checksum in CHECKSUMS.get(path.rpartition("/")[2], ())
