"""The shake of a hand: its measured spectrum."""

import numpy as np
import pytest
from scipy.signal import welch

from digs_warp.sim.camera.walk.hand_motion import (
    ANGLE_SHAKE,
    BANDS_HZ,
    PEAK,
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


def density(track: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    frequencies, power = welch(track, fs=SAMPLE_RATE, nperseg=2048, axis=0)
    return frequencies, power.sum(axis=1)


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


@pytest.mark.parametrize(("index", "slope"), [(0, -4.0), (1, -3.2)])
def test_the_spectrum_falls_off_as_measured(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, slope: float
) -> None:
    frequencies, power = density(long_tracks[index])
    fitted = (frequencies >= 1) & (frequencies <= 10)
    found = np.polyfit(np.log(frequencies[fitted]), np.log(power[fitted]), 1)[0]
    # Bands with an RMS of their own and the tremor hump bend the line a little.
    assert found == pytest.approx(slope, abs=0.5)


def test_tremor_rises_over_the_slope(long_tracks: tuple[np.ndarray, np.ndarray]) -> None:
    frequencies, power = density(long_tracks[0])
    flattened = power * frequencies**4
    peak = flattened[(frequencies > 8) & (frequencies < 9)].mean()
    assert peak > 1.8 * flattened[(frequencies > 5) & (frequencies < 6)].mean()
    assert peak > 1.8 * flattened[(frequencies > 11.5) & (frequencies < 12.5)].mean()


@pytest.mark.parametrize(("index", "spectrum"), list(enumerate(SPECTRA)))
def test_no_peak_is_rarer_than_the_framing_allows_for(
    long_tracks: tuple[np.ndarray, np.ndarray], index: int, spectrum: ShakeSpectrum
) -> None:
    largest = np.abs(long_tracks[index]).max()
    assert 0.9 * PEAK * spectrum.axis_rms < largest <= PEAK * spectrum.axis_rms
