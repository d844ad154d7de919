"""S3, by a server of moto: files and tiles in and out, by ranges; what fails says why, and leaves nothing."""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import isocodec
from commands import fails, ok
from isocodec.errors import IsoError
from tiled import encoded, hilly, pieces, tiled_of

pytestmark = pytest.mark.heavy
FIELD = hilly((600, 600))
KEYS = ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")


class Store:
    """A server with a bucket ``maps``: its address, what it was asked for, and what it refuses."""

    def __init__(self) -> None:
        from moto.server import ThreadedMotoServer

        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        self._server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
        self._server.start()
        self.address = "http://{}:{}".format(*self._server.get_host_and_port())
        self.asked: list[tuple[str, int]] = []
        """Methods, and bytes of their ranges."""
        self.refused = ""
        """A method that is answered by 403."""
        self._app, self._server._server.app = self._server._server.app, self

    def __call__(self, environ: dict[str, Any], start: Any) -> Any:
        method, span = environ["REQUEST_METHOD"], environ.get("HTTP_RANGE", "bytes=0--1")
        first, last = map(int, span.removeprefix("bytes=").split("-", 1))
        self.asked.append((method, last + 1 - first))
        if method == self.refused:
            start("403 Forbidden", [("Content-Length", "0")])
            return []
        return self._app(environ, start)

    def stop(self) -> None:
        self._server.stop()


@pytest.fixture(scope="module")
def server() -> Iterator[Store]:
    for name in ("moto", "s3fs"):
        pytest.importorskip(name)
    store = Store()
    yield store
    store.stop()


@pytest.fixture
def store(server: Store, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Store]:
    monkeypatch.setenv("AWS_ENDPOINT_URL", server.address)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with key("any", "any"):
        bucket().create()
        server.asked.clear()
        yield server
        server.refused = ""
        bucket().objects.delete()
        bucket().delete()


class key:
    """Requests are signed with this key; other packages keep what they have read from the environment."""

    def __init__(self, *values: str) -> None:
        self._set, self._values = pytest.MonkeyPatch(), values

    def __enter__(self) -> None:
        for name, value in zip(KEYS, self._values, strict=False):
            self._set.setenv(name, value)
        forget()

    def __exit__(self, *_: object) -> None:
        self._set.undo()
        forget()


def forget() -> None:
    from s3fs import S3FileSystem

    S3FileSystem.clear_instance_cache()


def bucket() -> Any:
    import boto3

    return boto3.session.Session().resource("s3").Bucket("maps")


def held() -> dict[str, bytes]:
    return {each.key: each.get()["Body"].read() for each in bucket().objects.all()}


def test_files_and_tiles_in_and_out(store: Store, tmp_path: Path) -> None:
    np.save(tmp_path / "field.npy", FIELD)
    tiled_name = f"s3://maps/{'t' * 300}.iso"  # longer than names of files may be
    isocodec.save("s3://maps/a/whole.iso", FIELD, 30.5)
    isocodec.save(tiled_name, FIELD, 30.5, tile=32)
    encode = ("encode", tmp_path / "field.npy", "--isovalue", 30.5, "-o")
    ok(*encode, "s3://maps/b.iso")
    ok(*encode, "s3://maps/c.iso", "--tile", 32)
    ok("edit", "s3://maps/b.iso", "--layers", 3, "-o", "s3://maps/few.iso")
    ok("decode", "s3://maps/b.iso", "-o", "s3://maps/lines.geojson")
    whole, tiles = isocodec.encode(FIELD, 30.5), encoded(tmp_path, FIELD, 30.5)
    local = tmp_path / "lines.geojson"
    isocodec.save(local, whole)
    assert held() == {
        "a/whole.iso": whole, "b.iso": whole, tiled_name[10:]: tiles, "c.iso": tiles,
        "few.iso": isocodec.open(whole).edited(layers=3), "lines.geojson": local.read_bytes(),
    }
    assert "600 x 600" in ok("info", "s3://maps/b.iso")
    assert isocodec.open("s3://maps/a/whole.iso").data == whole


def test_of_a_window_few_bytes_are_read(store: Store, tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 100, (600, 600))
    data, box = encoded(tmp_path, noise, 50.5, precision="exact"), [(300, 330), (400, 430)]
    isocodec.save("s3://maps/tiles.iso", data)
    store.asked.clear()
    found = isocodec.open("s3://maps/tiles.iso").contour(window=box)
    assert pieces(found) == pieces(tiled_of(data).window(box))
    methods, sizes = zip(*store.asked, strict=True)
    assert {*methods} == {"GET"} and len(sizes) <= 8 and 0 < sum(sizes) < len(data) / 3


class Stopping:
    """A field that can be read twice."""

    shape, dtype = FIELD.shape, FIELD.dtype
    times = 2

    def __getitem__(self, window: Any) -> np.ndarray:
        self.times -= 1
        if self.times < 0:
            raise OSError("the disk is gone")
        return FIELD[window]


@pytest.mark.parametrize("what, options", [
    (FIELD, {"precision": "nonsense"}), (Stopping(), {"tile": 32}), (None, {}), (None, {"tile": 256}),
])
def test_what_fails_leaves_what_was_there(store: Store, tmp_path: Path, what: Any, options: dict[str, Any]) -> None:
    """None stands for a store that takes nothing. Tiles stay on this machine, and the next call goes on with them."""
    isocodec.save("s3://maps/map.iso", b"before")
    if what is None:
        store.refused, what = "PUT", FIELD
    with pytest.raises((IsoError, OSError), match=r"nonsense|disk|Forbidden"):
        isocodec.save("s3://maps/map.iso", what, 30.5, **options)
    assert held() == {"map.iso": b"before"} and not [*bucket().multipart_uploads.all()]
    left = {path.suffix for path in tmp_path.iterdir()}
    assert left == ({".tiles"} if "tile" in options else set())
    store.refused = ""
    if "tile" in options:
        isocodec.save("s3://maps/map.iso", FIELD, 30.5, **options)
        assert held() == {"map.iso": encoded(tmp_path, FIELD, 30.5, **options)}
        assert not [*tmp_path.glob("*.tiles")]


def test_what_is_missing_or_forbidden_is_named(store: Store, tmp_path: Path) -> None:
    """Exit codes of the command line, and that nothing is written."""
    import boto3
    import requests

    isocodec.save("s3://maps/map.iso", FIELD, 30.5)
    np.save(tmp_path / "field.npy", FIELD)
    user = boto3.session.Session().resource("iam").create_user(UserName="somebody")
    pair = user.create_access_key_pair()

    def refused(wanted: str, code: int = 3, name: str = "s3://maps/map.iso") -> None:
        for verb in (("info", name), ("encode", tmp_path / "field.npy", "--isovalue", 30.5, "-o", name)):
            line = fails(code, *verb)
            assert wanted in line and name in line

    refused("no such bucket, folder or file", name="s3://nowhere/map.iso")
    assert "no such bucket, folder or file" in fails(3, "decode", "s3://maps/none.iso", "-o", tmp_path / "x.npz")
    before = held()
    requests.post(f"{store.address}/moto-api/reset-auth", data=b"0", timeout=9)
    try:
        with key("wrong", "x"):
            refused("does not exist in our records")
        with key(pair.id, "wrong"):
            refused("signature")
        with key(pair.id, pair.secret):
            refused("Access Denied")
    finally:
        requests.post(f"{store.address}/moto-api/reset-auth", data=b"inf", timeout=9)
    assert held() == before
    monkeypatch = pytest.MonkeyPatch()
    with monkeypatch.context() as without:
        for name in KEYS:
            without.delenv(name)
        without.setenv("HOME", str(tmp_path))
        forget()
        refused("credentials")
    with monkeypatch.context() as elsewhere:
        elsewhere.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
        elsewhere.setenv("AWS_MAX_ATTEMPTS", "1")
        forget()
        refused("Could not connect to the endpoint")
