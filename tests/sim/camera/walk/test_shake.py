"""The shake of a hand: its measured spectrum."""

import numpy as np
import pytest
from scipy.signal import welch

from digs_warp.sim.camera.walk.hand_motion import (
    ANGLE_SHAKE,
    BANDS_HZ,
    POSITION_SHAKE,
    SAMPLE_RATE,
    ShakeSpectrum,
    shake_tracks,
)

SPECTRA = (POSITION_SHAKE, ANGLE_SHAKE)


@pytest.fixture(scope="module")
def long_tracks() -> tuple[np.ndarray, np.ndarray]:
    """Forty minutes of shake."""
    return shake_tracks(int(2400 * SAMPLE_RATE), np.random.SeedSequence(5))


@pytest.mark.parametrize(("index", "spectrum"), list(enumerate(SPECTRA)))
def test_every_band_has_the_measured_rms(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, spectrum: ShakeSpectrum
) -> None:
    track = long_tracks[index]
    frequencies = np.fft.rfftfreq(len(track), 1 / SAMPLE_RATE)
    power = 2 * (np.abs(np.fft.rfft(track, axis=0)) ** 2).sum(axis=1) / len(track) ** 2
    for (low, high), expected in zip(BANDS_HZ, spectrum.band_rms, strict=True):
        rms = np.sqrt(power[(frequencies >= low) & (frequencies < high)].sum())
        assert rms == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize(("index", "slope", "rise"), [(0, 4.0, 1.8), (1, 3.2, 1.0)])
def test_the_spectrum_falls_off_as_measured_and_tremor_rises_over_it(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, slope: float, rise: float
) -> None:
    f, power = welch(long_tracks[index], fs=SAMPLE_RATE, nperseg=2048, axis=0)
    f, power = f[1:], power.sum(axis=1)[1:]
    fitted = (f >= 1) & (f <= 10)
    found = -np.polyfit(np.log(f[fitted]), np.log(power[fitted]), 1)[0]
    # Bands with an RMS of their own and the tremor hump bend the line a little.
    assert found == pytest.approx(slope, abs=0.5)
    flat = power * f**slope
    peak, before, after = (flat[(f > low) & (f < low + 1)].mean() for low in (8, 5, 11.5))
    assert peak > rise * max(before, after)
