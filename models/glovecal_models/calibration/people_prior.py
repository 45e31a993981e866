"""What other people's takes say of a person nobody has calibrated: a prior of the plane of each rotation.

A linear mixed model (Laird & Ware 1982) in the readings of one rotation's sensors. A take's plane is that of
the population and a deviation of the person, of the wearing and of the take, each normal with a variance for
every coefficient; around it lie the errors of single frames, which are autocorrelated and count as fewer
(``effective_sample_ratio``). The variances are the likeliest of the people's takes, each leaning on a broad
prior as there are few people. All else is closed form: the takes of a new person, or of a new wearing of a
known one, make of the prior the plane that is served. With no own take it is the prior's mean, with many the
plane of the own takes alone.

A prior is means and variances: no reading, angle or name of a person is in it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from glovecal_models.calibration.sample_weight import effective_sample_ratio
from glovecal_models.calibration.samples import gather_samples, linear_correspondence
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput, NotTrainable
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.takes.take import Take

FORMAT = "glovecal.people.v1"
FEWEST_PEOPLE = 2
"""From one person nothing is known of how people differ."""
EXPECTED_SHARE = {"person": 0.5, "wearing": 0.25, "take": 0.12, "frame": 0.12}
"""Standard deviations expected before any take, as shares of the rotation's own: a coefficient is degrees
over one standard deviation of its sensor."""
LOG_SD = 0.75
"""Of the logarithm of a standard deviation about the expected one. From 0.35 to 1.5, and with other shares
above, errors on three people's ankles change by a tenth at most."""
POPULATION_SHARE = 3.0
"""Of the rotation's standard deviation: how large a coefficient of the population could be."""
LEVELS: tuple[str, ...] = ("person", "wearing", "take")


class TakeSums(NamedTuple):
    """One take of one rotation, K = D + 1 coefficients; rows counted by their effective number."""

    square: np.ndarray
    """(K, K)."""
    right: np.ndarray
    """(K,)."""
    target_square: float
    samples: float

    def scaled(self, ratio: float) -> TakeSums:
        """Where every row counts ``ratio``, and all of them one at least: a held pose is one sample."""
        ratio = max(ratio, 1.0 / max(self.samples, 1.0))
        return TakeSums(
            ratio * self.square, ratio * self.right, ratio * self.target_square, ratio * self.samples
        )


Person = Mapping[str, Sequence[TakeSums]]
"""By wearing."""


@dataclass(frozen=True)
class PeoplePlane:
    """The prior of one rotation's plane; coefficients are of [x 1], x = (readings - shift) / scale."""

    rotation: str
    sensors: tuple[str, ...]
    people: int
    wearings: int
    input_shift: tuple[float, ...]
    """(D,), counts."""
    input_scale: tuple[float, ...]
    mean: tuple[float, ...]
    """(K,), degrees: of the population, or of the person where ``knows_person``."""
    covariance: tuple[tuple[float, ...], ...]
    """(K, K): what is uncertain of ``mean``."""
    person_variance: tuple[float, ...]
    """(K,): of people about the mean; zeros where the person is known."""
    wearing_variance: tuple[float, ...]
    """(K,): of one person's wearings."""
    take_variance: tuple[float, ...]
    """(K,): of takes of one wearing, such as other motions."""
    frame_variance: float
    """Degrees squared, of single frames about their take's plane."""
    sample_ratio: float
    """What one frame counts for, as its errors are autocorrelated."""
    low: tuple[float, ...]
    """(D,): smallest reading of the people, counts."""
    high: tuple[float, ...]
    knows_person: bool = False

    def sums(self, inputs: np.ndarray, target: np.ndarray) -> TakeSums:
        """Of one take: inputs (N, D) counts, target (N,) degrees."""
        return _sums(self._basis(inputs), target).scaled(self.sample_ratio)

    def regressor(
        self, takes: Mapping[str, Sequence[tuple[np.ndarray, np.ndarray]]], wearing: str | None = None
    ) -> LinearRegressor:
        """The plane after own ``takes`` (inputs, target) by wearing; none: what the people alone say.

        It is that of ``wearing``, if it is one of the takes', else of their only wearing, else of one more
        wearing. The claimed variance has what one more take may deviate by.
        """
        if wearing is not None and wearing in takes and len(takes) > 1:
            earlier = {name: own for name, own in takes.items() if name != wearing}
            return self.of_person(earlier).regressor({wearing: takes[wearing]})
        person = {name: [self.sums(*take) for take in own] for name, own in takes.items()}
        if len(person) == 1:
            (own,) = person.values()
            start = np.diag(np.add(self.person_variance, self.wearing_variance)) + np.array(self.covariance)
            mean, covariance = _after(np.array(self.mean), start, [self._of_take(take) for take in own])
        else:
            mean, covariance = self._person(person)
            covariance = covariance + np.diag(self.wearing_variance)
        covariance = covariance + np.diag(self.take_variance)
        values, vectors = np.linalg.eigh(covariance)
        return LinearRegressor(
            input_shift=np.array(self.input_shift),
            input_scale=np.array(self.input_scale),
            slope=mean[:-1],
            intercept=float(mean[-1]),
            variance_root=vectors * np.sqrt(np.maximum(values, 0.0)),
            noise_variance=self.frame_variance,
            evidence={"trainer": "people", "people": self.people, "wearings": self.wearings},
        )

    def of_person(self, takes: Mapping[str, Sequence[tuple[np.ndarray, np.ndarray]]]) -> PeoplePlane:
        """The prior of this person's next wearing, from takes of earlier ones."""
        person = {name: [self.sums(*take) for take in own] for name, own in takes.items()}
        mean, covariance = self._person(person)
        document = asdict(self) | {
            "mean": tuple(mean.tolist()),
            "covariance": tuple(map(tuple, covariance.tolist())),
            "person_variance": (0.0,) * len(mean),
            "knows_person": True,
        }
        return PeoplePlane(**document)

    def _person(self, person: Person) -> tuple[np.ndarray, np.ndarray]:
        """Mean (K,) and covariance (K, K) of the person's own plane."""
        spread = np.diag(self.wearing_variance)
        wearings = [
            _blurred(_total([self._of_take(take) for take in own]), spread) for own in person.values()
        ]
        start = np.array(self.covariance) + np.diag(self.person_variance)
        return _after(np.array(self.mean), start, wearings)

    def _of_take(self, take: TakeSums) -> Information:
        exact = Information(take.square / self.frame_variance, take.right / self.frame_variance)
        return _blurred(exact, np.diag(self.take_variance))

    def _basis(self, inputs: np.ndarray) -> np.ndarray:
        x = (np.asarray(inputs, dtype=float) - self.input_shift) / self.input_scale
        return np.column_stack([x, np.ones(len(x))])

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> PeoplePlane:
        """Inverse of ``asdict``, also after JSON. Raises BadInput."""
        names = {field.name for field in fields(cls)}
        try:
            if set(document) != names:
                raise ValueError
            item = cls(**{name: _as_tuples(value) for name, value in document.items()})
            count = len(item.sensors)
            shapes = {"input_shift": count, "input_scale": count, "low": count, "high": count}
            shapes |= {"mean": count + 1} | {f"{level}_variance": count + 1 for level in LEVELS}
            arrays = {name: np.array(getattr(item, name), dtype=float) for name in (*shapes, "covariance")}
            right = all(arrays[name].shape == (length,) for name, length in shapes.items())
            right = right and arrays["covariance"].shape == (count + 1, count + 1) and count > 0
            right = right and all(np.isfinite(array).all() for array in arrays.values())
            right = right and all(arrays[f"{level}_variance"].min() >= 0 for level in LEVELS)
            right = right and arrays["input_scale"].min() > 0 and 0 < item.sample_ratio <= 1
            right = right and item.frame_variance > 0 and np.linalg.eigvalsh(arrays["covariance"])[0] > -1e-6
            if not right:
                raise ValueError
        except (TypeError, ValueError, AttributeError, np.linalg.LinAlgError):
            raise BadInput(
                "a plane of this prior of people is incomplete or damaged; write the file again"
            ) from None
        return item


@dataclass(frozen=True)
class PeoplePrior:
    """The priors of all rotations of a layout that two people or more were measured in."""

    layout: str
    planes: tuple[PeoplePlane, ...]

    def plane(self, rotation: str) -> PeoplePlane | None:
        return next((plane for plane in self.planes if plane.rotation == rotation), None)

    def of_person(self, takes: Sequence[Take]) -> PeoplePrior:
        """The prior of this person's next wearing, from ``takes`` of earlier ones; itself where none."""
        planes = []
        for plane in self.planes:
            own = own_takes(takes, plane)
            planes.append(plane.of_person(own) if own else plane)
        return PeoplePrior(self.layout, tuple(planes))

    def dump(self) -> str:
        """As JSON, with the sha256 of what it says."""
        return json.dumps(self.to_document(), indent=1) + "\n"

    def to_document(self) -> dict[str, Any]:
        """Plain JSON-able data."""
        planes = [{name: _as_lists(value) for name, value in asdict(plane).items()} for plane in self.planes]
        document = {"layout": self.layout, "planes": planes}
        return {"format": FORMAT, "sha256": _hash(document), **document}

    @classmethod
    def load(cls, content: str | bytes, name: str) -> PeoplePrior:
        """Inverse of ``dump``; ``name`` begins the sentence. Raises BadInput."""
        return cls.from_document(read_json(content, name), name)

    @classmethod
    def from_document(cls, read: Any, name: str) -> PeoplePrior:
        """Inverse of ``to_document``. Raises BadInput."""
        if not isinstance(read, Mapping) or read.get("format") != FORMAT:
            raise BadInput(f"{name} is no prior of people; write one: glovecal glove people LAYOUT FILE")
        document = {key: read.get(key) for key in ("layout", "planes")}
        if read.get("sha256") != _hash(document):
            raise BadInput(f"{name} was changed after it was written: its sha256 is another; write it again")
        if not isinstance(document["layout"], str) or not isinstance(document["planes"], list):
            raise BadInput(f"{name} names no layout or holds no planes; write it again")
        return cls(document["layout"], tuple(PeoplePlane.from_document(item) for item in document["planes"]))


def people_prior(takes: Mapping[str, Sequence[Take]], layout: Layout) -> PeoplePrior:
    """Of the people whose ``takes`` these are, by person. Rotations measured in fewer than two people have
    no prior. Raises NotTrainable where there is no such rotation, LayoutMismatch."""
    planes = []
    for item in (each for each in layout.correspondences if each.simulated is None):
        plane = _learned(takes, linear_correspondence(item))
        if plane is not None:
            planes.append(plane)
    if not planes:
        raise NotTrainable(
            f"no rotation of layout {layout.name} was measured in {FEWEST_PEOPLE} other people; train "
            "without a prior, or import takes of more people"
        )
    return PeoplePrior(layout.name, tuple(planes))


def own_takes(takes: Sequence[Take], plane: PeoplePlane) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Inputs (N, D) and target (N,) of each take in which the rotation was measured, by wearing."""
    return _measured(
        takes, Correspondence(plane.rotation, "MS1R" if len(plane.sensors) > 1 else "1S1R", plane.sensors)
    )


def plane_of_people(
    planes: Sequence[PeoplePlane], rotation: str, sensors: Sequence[str]
) -> PeoplePlane | None:
    """The one of ``rotation``; None where it reads other sensors, as when one of them is dead."""
    return next((one for one in planes if (one.rotation, one.sensors) == (rotation, tuple(sensors))), None)


def takes_by_wearing(
    inputs: np.ndarray, target: np.ndarray, take: np.ndarray, wearings: Sequence[str]
) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Samples of several takes, each of number ``take`` (N,), as ``PeoplePlane.regressor`` wants them."""
    by_wearing: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for number in np.unique(take):
        rows = take == number
        by_wearing.setdefault(wearings[int(number)], []).append((inputs[rows], target[rows]))
    return by_wearing


class Information(NamedTuple):
    """What is known of K coefficients: precision (K, K), and precision times mean (K,)."""

    precision: np.ndarray
    right: np.ndarray


def _total(parts: Sequence[Information]) -> Information:
    return Information(
        np.sum([part.precision for part in parts], axis=0), np.sum([part.right for part in parts], axis=0)
    )


def _blurred(own: Information, spread: np.ndarray) -> Information:
    """What is known of a mean that ``own``'s coefficients deviate from with covariance ``spread``."""
    kept = np.linalg.inv(np.eye(len(spread)) + own.precision @ spread)
    return Information(kept @ own.precision, kept @ own.right)


def _after(
    mean: np.ndarray, covariance: np.ndarray, seen: Sequence[Information]
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance once ``seen`` is known too."""
    if not seen:
        return mean, covariance
    all_of_it = _total(seen)
    kept = np.linalg.inv(np.eye(len(mean)) + covariance @ all_of_it.precision)
    after = kept @ covariance
    return kept @ (mean + covariance @ all_of_it.right), (after + after.T) / 2


def _sums(basis: np.ndarray, target: np.ndarray) -> TakeSums:
    return TakeSums(basis.T @ basis, basis.T @ target, float(target @ target), float(len(target)))


def _measured(takes: Sequence[Take], item: Correspondence) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    by_wearing: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for take in takes:
        samples = gather_samples([take], item)
        if len(samples):
            by_wearing.setdefault(take.wearing, []).append((samples.inputs, samples.target))
    return by_wearing


def _learned(takes: Mapping[str, Sequence[Take]], item: Correspondence) -> PeoplePlane | None:
    """None where fewer than two people were measured."""
    people = [own for own in (_measured(each, item) for each in takes.values()) if own]
    if len(people) < FEWEST_PEOPLE:
        return None
    every = [take for own in people for wearing in own.values() for take in wearing]
    inputs, target = np.concatenate([x for x, _ in every]), np.concatenate([y for _, y in every])
    shift, scale = inputs.mean(axis=0), inputs.std(axis=0)
    if not (scale > 0).all() or np.ptp(target) == 0:
        return None

    def basis(x: np.ndarray) -> np.ndarray:
        return np.column_stack([(x - shift) / scale, np.ones(len(x))])

    ratio = _sample_ratio([[(basis(x), y) for x, y in w] for own in people for w in own.values()])
    sums = [[[_sums(basis(x), y).scaled(ratio) for x, y in w] for w in own.values()] for own in people]
    tree = _Tree(sums, float(target.std()))
    tree.learn()
    mean, covariance = tree.population()
    return PeoplePlane(
        rotation=item.rotation,
        sensors=item.inputs,
        people=len(people),
        wearings=sum(len(own) for own in people),
        input_shift=tuple(shift.tolist()),
        input_scale=tuple(scale.tolist()),
        mean=tuple(mean.tolist()),
        covariance=tuple(map(tuple, covariance.tolist())),
        person_variance=tuple(tree.variance["person"].tolist()),
        wearing_variance=tuple(tree.variance["wearing"].tolist()),
        take_variance=tuple(tree.variance["take"].tolist()),
        frame_variance=float(tree.frame_variance),
        sample_ratio=ratio,
        low=tuple(inputs.min(axis=0).tolist()),
        high=tuple(inputs.max(axis=0).tolist()),
    )


def _sample_ratio(wearings: Sequence[Sequence[tuple[np.ndarray, np.ndarray]]]) -> float:
    """From the errors that each wearing's own plane leaves."""
    errors, owners, positions = [], [], []
    for takes in wearings:
        basis, target = np.concatenate([b for b, _ in takes]), np.concatenate([y for _, y in takes])
        plane = np.linalg.lstsq(basis, target, rcond=1e-10)[0]
        for own, angles in takes:
            errors.append(angles - own @ plane)
            owners.append(np.full(len(angles), len(owners)))
            positions.append(np.arange(len(angles)))
    return effective_sample_ratio(np.concatenate(errors), np.concatenate(owners), np.concatenate(positions))


_PersonInformation = tuple[Information, list[tuple[Information, list[Information]]]]
"""Of a person, of each wearing, of each of its takes."""


class _Tree:
    """People, their wearings, these wearings' takes; the variances of the levels, and what follows of them.

    Information goes up from takes to the population, what is known then comes down again: the derivative of
    the likelihood by a variance is that of the expected squares of its deviations (Fisher's identity).
    """

    def __init__(self, people: Sequence[Sequence[Sequence[TakeSums]]], scale: float) -> None:
        self._people, self._size = people, len(people[0][0][0].right)
        self._expected = np.concatenate(
            [np.full(self._size, 2 * np.log(EXPECTED_SHARE[level] * scale)) for level in LEVELS]
            + [[2 * np.log(EXPECTED_SHARE["frame"] * scale)]]
        )
        self._population = np.eye(self._size) * (POPULATION_SHARE * scale) ** 2
        self._set(self._expected)

    def _set(self, log_variance: np.ndarray) -> None:
        parts = np.exp(log_variance[:-1]).reshape(len(LEVELS), -1)
        self.variance: dict[str, np.ndarray] = dict(zip(LEVELS, parts, strict=True))
        self.frame_variance = float(np.exp(log_variance[-1]))

    def learn(self) -> None:
        """The most probable variances."""
        from scipy.optimize import minimize  # slow to load, and every model loads this file

        optimum = minimize(self._objective, self._expected, jac=True, method="L-BFGS-B")
        self._set(optimum.x)

    def population(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (K,) and covariance (K, K) of the population's plane."""
        return self._upward()[0]

    def _upward(self) -> tuple[tuple[np.ndarray, np.ndarray], list[_PersonInformation]]:
        """Mean and covariance of the population, and what is known of each person, wearing and take."""
        frame = self.frame_variance
        spread = {level: np.diag(self.variance[level]) for level in LEVELS}
        people = []
        for person in self._people:
            wearings = []
            for takes in person:
                leaves = [Information(take.square / frame, take.right / frame) for take in takes]
                wearings.append((_total([_blurred(leaf, spread["take"]) for leaf in leaves]), leaves))
            people.append((_total([_blurred(each, spread["wearing"]) for each, _ in wearings]), wearings))
        seen = [_blurred(each, spread["person"]) for each, _ in people]
        return _after(np.zeros(self._size), self._population, seen), people

    def _objective(self, log_variance: np.ndarray) -> tuple[float, np.ndarray]:
        """Negative logarithm of the posterior density, and its gradient."""
        self._set(log_variance)
        (mean, covariance), people = self._upward()
        gradient: dict[str, np.ndarray] = {level: np.zeros(self._size) for level in LEVELS}
        total, frame_gradient = 0.0, 0.0

        def down(level: str, own: Information, mean: np.ndarray, covariance: np.ndarray) -> Any:
            """A deviation's place in the likelihood, and mean and covariance of what it is added to."""
            nonlocal total
            variance = self.variance[level]
            inner = np.linalg.inv(np.diag(1 / variance) + own.precision)
            kept = np.eye(self._size) - inner @ own.precision
            deviation = inner @ (own.right - own.precision @ mean)
            moved = inner @ own.precision
            square = deviation**2 + np.diag(inner + moved @ covariance @ moved.T)
            gradient[level] += 0.5 * (1 - square / variance)
            total += 0.5 * (np.log(variance).sum() - np.linalg.slogdet(inner)[1])
            total -= 0.5 * float(own.right @ inner @ own.right)
            return mean + deviation, kept @ covariance @ kept.T + inner

        for (person, wearings), sums in zip(people, self._people, strict=True):
            of_person = down("person", person, mean, covariance)
            for (wearing, leaves), takes in zip(wearings, sums, strict=True):
                of_wearing = down("wearing", wearing, *of_person)
                for leaf, take in zip(leaves, takes, strict=True):
                    plane, uncertain = down("take", leaf, *of_wearing)
                    square = take.target_square - 2 * take.right @ plane
                    square += float(np.sum(take.square * (uncertain + np.outer(plane, plane))))
                    frame_gradient += 0.5 * (take.samples - square / self.frame_variance)
                    total += 0.5 * (take.target_square / self.frame_variance)
                    total += 0.5 * take.samples * log_variance[-1]
        seen = _total([_blurred(each, np.diag(self.variance["person"])) for each, _ in people])
        total -= 0.5 * float(seen.right @ covariance @ seen.right) + 0.5 * np.linalg.slogdet(covariance)[1]
        off = (log_variance - self._expected) / (2 * LOG_SD)
        by_level = [gradient[level] for level in LEVELS]
        slope = np.concatenate([*by_level, [frame_gradient]]) + off / (2 * LOG_SD)
        return total + 0.5 * float(off @ off), slope


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def _as_lists(value: Any) -> Any:
    return list(map(_as_lists, value)) if isinstance(value, tuple) else value


def _hash(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
