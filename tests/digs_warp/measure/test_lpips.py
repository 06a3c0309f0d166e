# torch is an extra that type checking need not have:
# pyright: reportMissingImports=false
"""LPIPS, where torch is installed: with weights drawn at random, against the formula written out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from digs_warp.checks import DigsError
from digs_warp.measure.lpips import MIN_SIZE, Lpips, Network

torch = pytest.importorskip("torch", reason="torch is not installed")

SHAPES: dict[str, dict[int, tuple[int, int, int]]] = {
    "alex": {
        0: (64, 3, 11),
        3: (192, 64, 5),
        6: (384, 192, 3),
        8: (256, 384, 3),
        10: (256, 256, 3),
    },
    "vgg": {
        number: (n, m, 3)
        for number, n, m in zip(
            (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28),
            (64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512),
            (3, 64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512),
            strict=True,
        )
    },
}
CHANNELS = {"alex": (64, 192, 384, 256, 256), "vgg": (64, 128, 256, 512, 512)}


@pytest.fixture(scope="module", params=["alex", "vgg"])
def files(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Weights of the right names and shapes, drawn at random."""
    network = request.param
    torch.manual_seed(0)
    folder = tmp_path_factory.mktemp(network)
    state = {}
    for number, (n, m, k) in SHAPES[network].items():
        state[f"features.{number}.weight"] = torch.randn(n, m, k, k) / (m * k * k) ** 0.5
        state[f"features.{number}.bias"] = torch.randn(n) * 0.1
    lines = {
        f"lin{i}.model.1.weight": torch.rand(1, n, 1, 1) for i, n in enumerate(CHANNELS[network])
    }
    torch.save(state, folder / "backbone.pth")
    torch.save(lines, folder / "lines.pth")
    return network, folder / "backbone.pth", folder / "lines.pth"


def images(size: int = 48) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    first = random.random((size, size + 16, 3))
    return first, np.clip(first + 0.2 * random.standard_normal(first.shape), 0, 1)


def sequential(network: Network, state: dict[str, Any]) -> tuple[Any, tuple[int, ...]]:
    """The backbone as a plain stack of layers, and after which of them features are taken."""
    nn = torch.nn
    conv = {
        number: nn.Conv2d(m, n, k, *((4, 2) if (network, number) == ("alex", 0) else (1, k // 2)))
        for number, (n, m, k) in SHAPES[network].items()
    }
    pools = {"alex": {2: 3, 5: 3}, "vgg": {4: 2, 9: 2, 16: 2, 23: 2}}[network]
    last = max(conv) + 2
    layers = [
        conv[i] if i in conv else nn.MaxPool2d(pools[i], 2) if i in pools else nn.ReLU()
        for i in range(last)
    ]
    stack = nn.Sequential(*layers)
    stack.load_state_dict({name.removeprefix("features."): value for name, value in state.items()})
    taps = {"alex": (1, 4, 7, 9, 11), "vgg": (3, 8, 15, 22, 29)}[network]
    return stack, taps


def test_the_distance_is_that_of_the_formula(files: Any) -> None:
    network, backbone, lines = files
    stack, taps = sequential(network, torch.load(backbone))
    weights = list(torch.load(lines).values())

    def features(image: np.ndarray) -> list[Any]:
        mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
        x = torch.from_numpy(image.astype(np.float32))
        x = ((x - mean) / std).permute(2, 0, 1)[None]
        found = []
        for number, layer in enumerate(stack):
            x = layer(x)
            if number in taps:
                found.append(torch.nn.functional.normalize(x, dim=1))
        return found

    first, second = images()
    with torch.no_grad():
        expected = sum(
            float((((a - b) ** 2) * w).sum(dim=1).mean())
            for a, b, w in zip(features(first), features(second), weights, strict=True)
        )
    found = Lpips(backbone, lines, network)(first, second)
    assert expected > 0.01
    assert found == pytest.approx(expected, rel=1e-3)


def test_an_image_has_no_distance_from_itself(files: Any) -> None:
    network, backbone, lines = files
    assert Lpips(backbone, lines, network)(images()[0], images()[0]) == 0.0


def test_files_of_the_other_network_are_refused(files: Any) -> None:
    network, backbone, lines = files
    other: Network = "vgg" if network == "alex" else "alex"
    with pytest.raises(DigsError, match=r"expected .* of torchvision"):
        Lpips(backbone, lines, other)


def test_broken_files_are_refused(files: Any, tmp_path: Path) -> None:
    network, backbone, lines = files
    broken = tmp_path / "broken.pth"
    broken.write_bytes(backbone.read_bytes()[:1000])
    with pytest.raises(DigsError, match="cannot be read"):
        Lpips(broken, lines, network)
    with pytest.raises(DigsError, match="no such file"):
        Lpips(backbone, tmp_path / "missing.pth", network)


def test_an_image_too_small_is_refused(files: Any) -> None:
    network, backbone, lines = files
    small = np.zeros((MIN_SIZE - 1, 64, 3))
    with pytest.raises(DigsError, match="at least"):
        Lpips(backbone, lines, network)(small, small)
