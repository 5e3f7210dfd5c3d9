#!/usr/bin/python3
"""Uploads photons to a treelightd, gathers around points, and compares the answers with numpy.

Needs Debian's python3-grpcio and python3-numpy, and the stubs that generate_stubs.sh makes of
photon_map.proto, the manual of the service. Exit codes: 0 all answers agree; 1 one differs, or a
call failed.
"""

import argparse
import os
import sys
import uuid
from dataclasses import dataclass

import grpc
import numpy as np

try:
    from treelight.v1 import photon_map_pb2 as pb
    from treelight.v1 import photon_map_pb2_grpc as rpc
except ModuleNotFoundError as error:
    sys.exit(f"gather.py: {error}; run generate_stubs.sh first, and name its folder in PYTHONPATH")

# Arrays travel as little-endian bytes, whatever this machine is.
F32, U32, U64 = np.dtype("<f4"), np.dtype("<u4"), np.dtype("<u8")

OUTPUTS = pb.OUTPUT_COUNT | pb.OUTPUT_RADIUS | pb.OUTPUT_NEIGHBORS | pb.OUTPUT_DENSITY


@dataclass
class Search:
    """What to gather around every query: at most `k` photons (0: all) within `radii` [m]."""

    name: str
    k: int
    radii: np.ndarray


@dataclass
class Found:
    """What one query found."""

    radius: np.float32  # distance of the k-th photon where k were found, else that of the search
    ids: np.ndarray  # [n] photon indices, nearest first, ties in order of index
    squared_distances: np.ndarray  # [n] float32
    density: np.ndarray  # [3] watts per scene unit squared


# ------------------------------------------------------------------------------------------ server


def upload(stub, limits, name, positions, powers):
    """Builds a map of photons, `positions` [n, 3] and `powers` [n, 3], both float32."""
    photons_per_chunk = limits.max_chunk_bytes // (positions[0].nbytes + powers[0].nbytes)

    def messages():
        yield pb.BuildPhotonMapRequest(
            header=pb.BuildHeader(
                name=name,
                photon_count=len(positions),
                has_powers=True,
                time_to_live_ms=600_000,  # in case this program dies before it deletes the map
                request_id=uuid.uuid4().hex,
            )
        )
        for first in range(0, len(positions), photons_per_chunk):
            chunk = slice(first, first + photons_per_chunk)
            yield pb.BuildPhotonMapRequest(
                chunk=pb.PhotonChunk(
                    positions=positions[chunk].tobytes(), powers=powers[chunk].tobytes()
                )
            )

    return stub.BuildPhotonMap(messages())


def gather(stub, photon_map, queries, search, queries_per_batch=256):
    """Gathers around `queries` [m, 3] float32. Returns [m] Found, and microseconds of kernels.

    The answer to a batch comes in one or more parts, so it may be larger than a message.
    """

    def batches():
        for first in range(0, len(queries), queries_per_batch):
            batch = slice(first, first + queries_per_batch)
            yield pb.GatherRequest(
                map=photon_map.name,
                version=photon_map.version,
                positions=queries[batch].tobytes(),
                radii=search.radii[batch].tobytes(),
                k=search.k,
                outputs=OUTPUTS,
                kernel=pb.DENSITY_KERNEL_EPANECHNIKOV,
            )

    found, kernel_us = [], 0.0
    for part in stub.GatherStream(batches()):
        counts = np.frombuffer(part.counts, U32)
        radii = np.frombuffer(part.radii, F32)
        ids = np.frombuffer(part.neighbor_ids, U32)
        squared_distances = np.frombuffer(part.neighbor_squared_distances, F32)
        densities = np.frombuffer(part.densities, F32).reshape(-1, 3)
        # Lists of at most k photons have k places each; lists of all photons begin at offsets.
        if search.k > 0:
            firsts = np.arange(part.query_count) * search.k
        else:
            firsts = np.frombuffer(part.neighbor_offsets, U64)
        for i, count in enumerate(counts):
            own = slice(int(firsts[i]), int(firsts[i]) + int(count))
            found.append(Found(radii[i], ids[own], squared_distances[own], densities[i]))
        kernel_us += part.timings.kernel_us  # not 0 in the last part of a batch
    return found, kernel_us


# ------------------------------------------------------------------------------------- brute force


def brute_force(coordinates, powers, query, k, radius):
    """What the server must answer: float32 distances without fused multiply-adds, ties by index.

    `coordinates` [3, n]: all x, all y, all z.
    """
    dx, dy, dz = coordinates - query[:, np.newaxis]
    squared_distances = (dx * dx + dy * dy) + dz * dz
    ids = np.flatnonzero(squared_distances <= radius * radius)
    ids = ids[np.argsort(squared_distances[ids], kind="stable")]
    if k > 0:
        ids = ids[:k]
        if len(ids) == k:
            radius = np.sqrt(squared_distances[ids[-1]])
    squared_distances = squared_distances[ids]
    return Found(radius, ids, squared_distances, density(powers[ids], squared_distances, radius))


def density(powers, squared_distances, radius):
    """Sum of power * weight in float64, the weight 2 (1 - d^2/R^2) / (pi R^2) (Epanechnikov)."""
    if radius == 0 or np.isinf(radius):
        return np.zeros(3)
    squared_radius = np.float64(radius) ** 2
    weights = np.maximum(0, 2 * (1 - squared_distances / squared_radius) / (np.pi * squared_radius))
    return weights @ powers.astype(np.float64)


def density_bound(powers, radius):
    """How far the float32 sum of a density may be from the one in float64 (docs/guarantees.md)."""
    if radius == 0 or np.isinf(radius):
        return np.zeros(3)
    peak = 2 / (np.pi * np.float64(radius) ** 2)
    return (len(powers) + 10) * 2.0**-24 * peak * np.abs(powers).sum(axis=0, dtype=np.float64)


# ------------------------------------------------------------------------------------------- check


def make_photons(count, random):
    """Positions [n, 3] in the unit cube, half of them on a grid where distances tie, and powers."""
    positions = random.random((count, 3), dtype=F32)
    positions[::2] = np.round(positions[::2] * 32) / 32
    return positions, random.random((count, 3), dtype=F32) / F32.type(count)


def check(stub, photon_map, positions, powers, queries, search):
    """Runs one search, prints its line of the table. Returns whether all answers agree."""
    answers, kernel_us = gather(stub, photon_map, queries, search)
    coordinates = np.ascontiguousarray(positions.T)
    neighbors = wrong_radii = wrong_neighbors = wrong_densities = 0
    for query, radius, answer in zip(queries, search.radii, answers, strict=True):
        expected = brute_force(coordinates, powers, query, search.k, radius)
        neighbors += len(expected.ids)
        wrong_radii += answer.radius != expected.radius
        wrong_neighbors += not (
            np.array_equal(answer.ids, expected.ids)
            and np.array_equal(answer.squared_distances, expected.squared_distances)
        )
        error = np.abs(answer.density - expected.density)
        wrong_densities += np.any(error > density_bound(powers[expected.ids], expected.radius))
    print(
        f"{search.name:<28} {len(queries):>7} {neighbors:>10} {wrong_radii:>11} "
        f"{wrong_neighbors:>15} {wrong_densities:>15} {kernel_us / 1000:>9.2f}"
    )
    return wrong_radii == wrong_neighbors == wrong_densities == 0


def run(stub, photon_count, query_count, seed):
    """Uploads, gathers, deletes. Returns whether all answers agree."""
    random = np.random.default_rng(seed)
    positions, powers = make_photons(photon_count, random)
    queries = random.random((query_count, 3), dtype=F32)
    queries[::4] = positions[random.integers(photon_count, size=len(queries[::4]))]
    # Steps of the grid: photons lie exactly at these distances, and "within" includes them.
    steps = random.integers(4, size=query_count).astype(F32) / F32.type(32)
    searches = [
        Search("20 nearest", 20, np.full(query_count, np.inf, F32)),
        Search("20 nearest within 0.04", 20, np.full(query_count, 0.04, F32)),
        Search("all within 0 to 3/32", 0, steps),
    ]

    info = stub.GetServerInfo(pb.GetServerInfoRequest())
    built = upload(stub, info.limits, f"python-{uuid.uuid4().hex}", positions, powers)
    print(
        f"treelightd {info.version}: {built.map.photon_count} photons, "
        f"{built.map.statistics.node_count} nodes, depth {built.map.statistics.depth}, "
        f"built in {built.timings.kernel_us / 1000:.1f} ms on {built.map.device}\n"
    )
    print(
        f"{'gather':<28} {'queries':>7} {'neighbours':>10} {'wrong radii':>11} "
        f"{'wrong neighbours':>15} {'wrong densities':>15} {'kernel ms':>9}"
    )
    try:
        # A list, not a generator: every search runs, whatever the one before it found.
        return all([check(stub, built.map, positions, powers, queries, s) for s in searches])
    finally:
        stub.DeletePhotonMap(pb.DeletePhotonMapRequest(name=built.map.name))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = os.environ.get("TREELIGHT_SERVER", "127.0.0.1:7543")
    parser.add_argument("--server", default=default, help="HOST:PORT or unix:PATH (%(default)s)")
    parser.add_argument("--photons", type=int, default=100_000, help="%(default)s")
    parser.add_argument("--queries", type=int, default=500, help="%(default)s")
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers (%(default)s)")
    arguments = parser.parse_args()
    try:
        with grpc.insecure_channel(arguments.server) as channel:
            stub = rpc.PhotonMapServiceStub(channel)
            agree = run(stub, arguments.photons, arguments.queries, arguments.seed)
    except grpc.RpcError as error:
        sys.exit(f"gather.py: {error.code().name}: {error.details()}")
    sys.exit(0 if agree else "gather.py: the server's answers differ from brute force")


if __name__ == "__main__":
    main()
