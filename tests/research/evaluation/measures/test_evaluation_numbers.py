"""PSNR, SSIM, Fréchet, MMD, intervals: closed forms, invariances, unbiasedness, direct sums."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import sqrtm

from objectmorpher_research.evaluation.bootstrap import mean_with_interval
from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.measures.fidelity import psnr, ssim
from objectmorpher_research.evaluation.measures.frechet import (
    Gaussian,
    fitted,
    frechet_distance,
    frechet_of_samples,
)
from objectmorpher_research.evaluation.measures.mmd import (
    Subsets,
    kid,
    paired_kid,
    polynomial_kernel,
    unbiased_mmd2,
)
from tests.photos import photo

F64 = 1e-9
SQRTM = 1e-6  # relative; scipy's matrix root of a product is that exact


def noisy(rgb: np.ndarray, sigma: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0, sigma, rgb.shape)
    return np.clip(rgb + noise, 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def cat() -> np.ndarray:
    return photo("chelsea")[40:200, 60:260].copy()


def test_psnr_of_a_known_difference(cat):
    low = np.minimum(cat, 250)
    assert psnr(low, low + np.uint8(5), [None])[0] == pytest.approx(20 * np.log10(255 / 5))
    assert psnr(cat, cat, [None]) == (float("inf"),)


def test_psnr_and_ssim_are_symmetric_and_fall_with_noise(cat):
    little, much = noisy(cat, 5), noisy(cat, 20)
    for measure in (psnr, ssim):
        assert measure(cat, much, [None]) == pytest.approx(measure(much, cat, [None]))
        assert measure(cat, much, [None])[0] < measure(cat, little, [None])[0]
    assert ssim(cat, cat, [None])[0] == pytest.approx(1, abs=F64)


def test_psnr_and_ssim_agree_with_scikit_image(cat):
    metrics = pytest.importorskip("skimage.metrics")
    other = noisy(cat, 12)
    theirs = metrics.structural_similarity(
        cat, other, channel_axis=-1, data_range=255,
        gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    )  # fmt: skip
    assert ssim(cat, other, [None])[0] == pytest.approx(theirs, abs=F64)
    assert psnr(cat, other, [None])[0] == pytest.approx(metrics.peak_signal_noise_ratio(cat, other))


def test_a_region_sees_only_itself(cat):
    region = np.zeros(cat.shape[:2])
    region[:, :80] = 1
    other = cat.copy()
    other[:, 100:] = noisy(cat, 30)[:, 100:]  # further from the region than SSIM's window reaches
    whole = np.ones_like(region)
    for measure, best in ((psnr, float("inf")), (ssim, 1)):
        inside, outside, everywhere, plain = measure(cat, other, [region, 1 - region, whole, None])
        assert inside == pytest.approx(best, abs=F64)
        assert outside < plain
        assert everywhere == pytest.approx(plain, abs=F64)
    assert np.isnan(psnr(cat, other, [np.zeros_like(region)])[0])


def test_pictures_of_two_sizes_are_refused(cat):
    with pytest.raises(EvaluationError, match=r"200 x 160 px and 199 x 160 px"):
        psnr(cat, cat[:, 1:], [None])


def random_gaussian(d: int, seed: int) -> Gaussian:
    random = np.random.default_rng(seed)
    root = random.normal(size=(d, d))
    return Gaussian(random.normal(size=d), root @ root.T)


def test_frechet_closed_forms():
    one = Gaussian(np.array([1.0]), np.array([[4.0]]))
    other = Gaussian(np.array([-2.0]), np.array([[9.0]]))
    assert frechet_distance(one, other) == pytest.approx(3**2 + (3 - 2) ** 2)  # (m-m')^2+(s-s')^2
    p, q = np.array([1.0, 4.0, 0.0]), np.array([9.0, 1.0, 25.0])  # commuting, one singular
    a, b = Gaussian(np.zeros(3), np.diag(p)), Gaussian(np.ones(3), np.diag(q))
    assert frechet_distance(a, b) == pytest.approx(3 + ((np.sqrt(p) - np.sqrt(q)) ** 2).sum())


def test_frechet_is_a_metric_that_rigid_motions_keep():
    a, b, c = (random_gaussian(6, seed) for seed in range(3))
    assert frechet_distance(a, a) == pytest.approx(0, abs=1e-6)  # roots of rounding errors
    assert frechet_distance(a, b) == pytest.approx(frechet_distance(b, a))
    ab, bc, ac = (frechet_distance(*pair) ** 0.5 for pair in ((a, b), (b, c), (a, c)))
    assert ac <= ab + bc
    turn = np.linalg.qr(np.random.default_rng(9).normal(size=(6, 6)))[0]
    turned = [Gaussian(turn @ g.mean + 3, turn @ g.covariance @ turn.T) for g in (a, b)]
    assert frechet_distance(*turned) == pytest.approx(ab**2)


def test_frechet_agrees_with_its_definition_by_a_matrix_root():
    a, b = random_gaussian(8, 3), random_gaussian(8, 4)
    root = sqrtm(a.covariance @ b.covariance)
    trace = np.trace(a.covariance + b.covariance - 2 * np.real(root))
    assert frechet_distance(a, b) == pytest.approx(((a.mean - b.mean) ** 2).sum() + trace, SQRTM)


@pytest.mark.parametrize(("n", "m", "d"), [(50, 40, 5), (6, 9, 30)])
def test_frechet_of_few_samples_is_that_of_their_gaussians(n, m, d):
    random = np.random.default_rng(1)
    x, y = random.normal(size=(n, d)), random.normal(0.5, 2, size=(m, d))
    expected = frechet_distance(fitted(x), fitted(y))
    assert frechet_of_samples(x, y) == pytest.approx(expected, rel=1e-6)
    assert frechet_of_samples(x, x) == pytest.approx(0, abs=1e-9)
    with pytest.raises(EvaluationError, match="two samples"):
        frechet_of_samples(x[:1], y)


def test_mmd_agrees_with_sums_over_all_pairs():
    random = np.random.default_rng(2)
    x, y = random.normal(size=(5, 3)), random.normal(1, 1, size=(5, 3))

    def k(u, v):
        return (u @ v / 3 + 1) ** 3

    n = range(5)
    within = sum(k(x[i], x[j]) + k(y[i], y[j]) for i in n for j in n if i != j) / 20
    assert polynomial_kernel(x, y)[1, 2] == pytest.approx(k(x[1], y[2]))
    across = sum(k(x[i], y[j]) for i in n for j in n) / 25
    assert unbiased_mmd2(x, y) == pytest.approx(within - 2 * across)
    across = sum(k(x[i], y[j]) for i in n for j in n if i != j) / 20
    assert paired_kid(x, y).value == pytest.approx(within - 2 * across)


def test_mmd_of_known_distributions():
    """One dimension, k = (xy + 1)^3: MMD^2 is 3 (Dm1)^2 + 3 (Dm2)^2 + (Dm3)^2 of the moments."""
    random = np.random.default_rng(3)
    x, y = random.normal(0, 1, size=(4000, 1)), random.normal(0.5, 1, size=(4000, 1))
    expected = 3 * 0.5**2 + 3 * 0.25**2 + (0.5**3 + 3 * 0.5) ** 2
    assert unbiased_mmd2(x, y) == pytest.approx(expected, rel=0.15)  # 4,000 samples


def test_both_estimators_are_unbiased_and_only_one_for_pairs():
    random = np.random.default_rng(4)
    apart, alike, paired = [], [], []
    for _ in range(2000):
        x, y = random.normal(size=(2, 6, 4))
        apart.append(unbiased_mmd2(x, y))
        edited = x + 0.05 * y  # the same things, a little changed
        alike.append(unbiased_mmd2(x, edited))
        paired.append(paired_kid(x, edited).value)
    for found in (apart, paired):
        assert abs(np.mean(found)) < 4 * np.std(found) / len(found) ** 0.5
    assert np.mean(alike) < -10 * np.std(alike) / len(alike) ** 0.5


def test_equal_sets_are_at_zero_for_pairs_and_below_it_for_kid():
    x = np.random.default_rng(5).normal(size=(20, 64))
    assert paired_kid(x, x).value == pytest.approx(0, abs=F64)
    assert kid(x, x, Subsets()).value < -0.01
    assert kid(x, x, Subsets()).low is None
    with pytest.raises(EvaluationError, match="at least two"):
        kid(x[:1], x[:1], Subsets())


def test_kid_over_subsets_is_repeatable_and_near_that_of_all():
    random = np.random.default_rng(6)
    x, y = random.normal(size=(60, 8)), random.normal(1, 1, size=(60, 8))
    found = kid(x, y, Subsets(50, 30, seed=1))
    assert found == kid(x, y, Subsets(50, 30, seed=1))
    assert found.low is not None and found.high is not None
    assert found.low < unbiased_mmd2(x, y) < found.high


def test_the_jackknife_covers_the_truth():
    random = np.random.default_rng(7)
    truth = 32 / 3  # E (x.y / 3 + 1)^3 of N(0, I) and N(1, I) in 3 dimensions, by their moments
    covered = 0
    for _ in range(200):
        x = random.normal(size=(100, 3))
        found = paired_kid(x, random.normal(1, 1, size=(100, 3)))
        assert found.low is not None and found.high is not None
        covered += found.low <= truth <= found.high
    assert covered >= 180  # of 190, less three deviations


def test_the_interval_of_a_mean():
    values = np.random.default_rng(8).normal(3, 2, 400)
    found = mean_with_interval(tuple(values))
    assert found.value == pytest.approx(values.mean())
    error = 1.96 * values.std() / 20
    assert (found.low, found.high) == pytest.approx(
        (values.mean() - error, values.mean() + error), abs=0.02
    )
    assert mean_with_interval((1.0, float("nan"))).value == 1
    assert mean_with_interval((2.0, 2.0)).low == 2
    assert mean_with_interval((float("inf"), 3.0)).low is None
