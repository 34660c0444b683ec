"""The compiled judgement of registered windows equals its formulae in numpy, bit for bit."""

import numpy as np

from navfw.flow import block_matching as judged
from navfw.flow import judge_registration, ramp, uniqueness
from navfw.numerics import Array

SHAPE = (12, 16)
LIMITS = (0.85, 0.97)


def _between(low: float, high: float, seed: int, *more: int) -> Array:
    return np.random.default_rng(seed).uniform(low, high, (*SHAPE, *more))


def test_uniqueness_is_the_ramp_of_the_ratio_of_mismatches() -> None:
    height, second = _between(0.2, 1.0, 1), _between(-1.0, 1.0, 2)
    inner = _between(0.0, 1.0, 3) > 0.3
    contrast = (1.0 - second) / np.maximum(1.0 - height, 1e-3)
    expected = np.where(inner, ramp(contrast, 1.0, 1.5), ramp(contrast, 1.3, 2.2))
    assert uniqueness(height, second, inner).tobytes() == expected.tobytes()
    assert 0.0 < expected.mean() < 1.0


def test_confidence_and_sigma_are_those_of_the_formulae() -> None:
    score, share = _between(0.8, 1.0, 4), _between(0.5, 1.0, 5)
    mixture, noise = _between(0.0, 2.5, 6), _between(0.0, 0.5, 7)
    shift, peak, unique = _between(-1.5, 1.5, 8, 2), _between(0.3, 1.0, 9), _between(0.0, 1.0, 10)
    noise[0, 0], score[0, 0] = np.inf, 0.0  # a window that was not registered
    confidence, sigma = judge_registration(
        score, share, mixture, noise, shift, peak, unique, LIMITS
    )
    expected = ramp(score, *LIMITS) * ramp(share, *judged._SAMPLES_INSIDE)
    expected *= ramp(peak, *judged._PEAK_CORRELATION) * unique
    expected *= 1.0 - ramp(np.linalg.norm(shift, axis=-1), *judged._REGISTRATION_SHIFT)
    expected *= 1.0 - ramp(mixture, *judged._MIXTURE)
    variance = (judged._REGISTRATION_SCALE * noise) ** 2 + judged._REGISTRATION_FLOOR
    variance += (judged._REGISTRATION_EXCESS * noise**2) ** 2
    assert confidence.tobytes() == expected.tobytes()
    assert confidence[0, 0] == 0.0 < confidence.max()
    assert np.isinf(sigma[0, 0])
    np.testing.assert_allclose(
        sigma, np.sqrt(variance + (judged._MIXTURE_SHARE * mixture) ** 2), rtol=1e-15
    )
