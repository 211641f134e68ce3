"""Unit quaternions (w, x, y, z), rotation matrices, and the axis turns of `--turn`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import F64


def matrices_from_quats(quats: np.ndarray) -> np.ndarray:
    """Rotation matrices (N, 3, 3) of quaternions (N, 4) wxyz, which need not be unit."""
    w, x, y, z = np.ascontiguousarray((quats / np.linalg.norm(quats, axis=1, keepdims=True)).T)
    matrices = np.empty((len(w), 3, 3), w.dtype)  # entry by entry: of millions nothing is copied
    matrices[:, 0, 0] = 1 - 2 * (y * y + z * z)
    matrices[:, 0, 1] = 2 * (x * y - w * z)
    matrices[:, 0, 2] = 2 * (x * z + w * y)
    matrices[:, 1, 0] = 2 * (x * y + w * z)
    matrices[:, 1, 1] = 1 - 2 * (x * x + z * z)
    matrices[:, 1, 2] = 2 * (y * z - w * x)
    matrices[:, 2, 0] = 2 * (x * z - w * y)
    matrices[:, 2, 1] = 2 * (y * z + w * x)
    matrices[:, 2, 2] = 1 - 2 * (x * x + y * y)
    return matrices


def matrix_from_vector(vector: np.ndarray) -> F64:
    """Rotation matrix (3, 3) about `vector` (3,) by its length in radians, any angle."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / max(angle, 1e-300)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def vector_from_matrix(matrix: np.ndarray, near: np.ndarray | None = None) -> F64:
    """The rotation vector (3,) of a rotation matrix (3, 3), radians.

    A rotation has many: turns of 360 degrees more, about its axis or against it. It is the one
    nearest to the vector `near` (3,), else the shortest.
    """
    w, x, y, z = quats_from_matrices(np.asarray(matrix, np.float64)[None])[0]
    half = float(np.linalg.norm([x, y, z]))
    angle = 2.0 * np.arctan2(half, w)
    if near is None or not np.any(near):
        axis = np.array([x, y, z]) / half if half > 1e-12 else np.array([0.0, 0.0, 1.0])
        return angle * axis
    is_whole = half < 1e-9  # no turn at all, or whole ones about any axis
    axis = near / np.linalg.norm(near) if is_whole else np.array([x, y, z]) / half
    turns = np.round((axis @ near - angle) / (2 * np.pi))
    return (angle + 2 * np.pi * turns) * axis


def turn_about(vector: np.ndarray, axis: np.ndarray) -> float:
    """Return the angle, radians, by which the rotation `vector` (3,) turns about unit `axis` (3,).

    The twist of swing and twist: one more turn by a about the axis adds a to it. Any angle where
    the rotation is about the axis itself; else it is in (-pi, pi], as whole turns are not told
    apart.
    """
    angle = float(np.linalg.norm(vector))
    along = float(vector @ axis)
    if abs(angle - abs(along)) < 1e-9 * max(angle, 1.0):  # about the axis itself, any angle
        return along
    twist = 2.0 * np.arctan2(np.sin(angle / 2) * along / angle, np.cos(angle / 2))
    return float(np.pi - (np.pi - twist) % (2 * np.pi))


def turned_by(vector: np.ndarray, more: np.ndarray) -> F64:
    """The rotation vector (3,) of `vector` and then `more` (3,), radians, any angles."""
    size = max(float(np.linalg.norm(vector)), float(np.linalg.norm(more)))
    if np.linalg.norm(np.cross(vector, more)) <= 1e-12 * max(size, 1e-6) ** 2:  # about one axis
        return np.asarray(vector + more, np.float64)
    both = matrix_from_vector(more) @ matrix_from_vector(vector)
    return vector_from_matrix(both, np.asarray(vector) + more)


def quats_from_matrices(matrices: np.ndarray) -> np.ndarray:
    """Unit quaternions (N, 4) wxyz, w >= 0, of rotation matrices (N, 3, 3).

    The largest of the four components is found first and the others follow from it, so no
    rotation loses digits (Shepperd 1978).
    """
    m = matrices
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], 1)
    a, b, c = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    candidates = np.stack(  # row r: the quaternion times 4 q_r
        [
            np.stack([squares[:, 0], a, b, c], 1),
            np.stack([a, squares[:, 1], xy, xz], 1),
            np.stack([b, xy, squares[:, 2], yz], 1),
            np.stack([c, xz, yz, squares[:, 3]], 1),
        ],
        axis=1,
    )
    quats = candidates[np.arange(len(m)), squares.argmax(1)]
    quats = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    return np.where(quats[:, :1] < 0, -quats, quats)


def quats_along(normals: F64) -> F64:
    """Quaternions (N, 4) wxyz of frames whose z axis is the normal (N, 3), unit."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    x = np.cross(helper, normals)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    frames = np.stack([x, np.cross(normals, x), normals], axis=2)
    return quats_from_matrices(frames)


def turn_matrix(yaw: float, pitch: float, roll: float) -> F64:
    """R_z(roll) R_x(pitch) R_y(yaw) (3, 3), degrees, right-handed, camera axes."""
    (cy, cx, cz), (sy, sx, sz) = (f(np.radians([yaw, pitch, roll])) for f in (np.cos, np.sin))
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_x @ about_y


def turn_of(matrix: np.ndarray) -> tuple[float, float, float]:
    """Yaw, pitch and roll, degrees, of a rotation (3, 3): the inverse of `turn_matrix`.

    Pitch is within 90 degrees. Where it is 90, yaw and roll turn about one axis, and roll is 0.
    """
    pitch = np.arcsin(np.clip(matrix[2, 1], -1.0, 1.0))
    if np.hypot(matrix[2, 0], matrix[2, 2]) < 1e-9:
        yaw, roll = np.arctan2(matrix[0, 2], matrix[0, 0]), 0.0
    else:
        yaw = np.arctan2(-matrix[2, 0], matrix[2, 2])
        roll = np.arctan2(-matrix[0, 1], matrix[1, 1])
    return float(np.degrees(yaw)), float(np.degrees(pitch)), float(np.degrees(roll))


@dataclass(frozen=True, eq=False)
class Gimbal:
    """Three rings: yaw about what is down, carried by pitch about what lies across the picture,
    carried by roll about the line of sight. About the camera's own axes it is `turn_matrix`.
    """

    down: F64  # (3,) camera axes, unit
    right: F64  # (3,) camera axes, unit, in the picture and across `down`

    @staticmethod
    def about(down: np.ndarray) -> Gimbal:
        """The gimbal of what stands so; `down` (3,) camera axes, not 0."""
        own = np.asarray(down, np.float64) / np.linalg.norm(down)
        right = np.array([own[1], -own[0], 0.0])
        size = float(np.linalg.norm(right))
        return Gimbal(own, right / size if size > 1e-6 else np.array([1.0, 0.0, 0.0]))

    def carried(self, pitch: float, roll: float) -> F64:
        """The rotation (3, 3) of what carries the ring for yaw, degrees."""
        tilted = matrix_from_vector(np.radians(pitch) * self.right)
        return turn_matrix(0.0, 0.0, roll) @ tilted

    def matrix(self, yaw: float, pitch: float, roll: float) -> F64:
        """The rotation (3, 3) of these angles, degrees."""
        return self.carried(pitch, roll) @ matrix_from_vector(np.radians(yaw) * self.down)

    def turn(self, angles: tuple[float, float, float]) -> tuple[float, float, float]:
        """Yaw, pitch and roll about the camera's axes of a turn by the gimbal's own, degrees."""
        return angles if self is CAMERA_GIMBAL else turn_of(self.matrix(*angles))

    def of(self, turn: tuple[float, float, float]) -> tuple[float, float, float]:
        """The gimbal's own angles of a turn about the camera's axes: the inverse."""
        return turn if self is CAMERA_GIMBAL else self.angles(turn_matrix(*turn))

    def angles(self, matrix: np.ndarray) -> tuple[float, float, float]:
        """Yaw, pitch and roll, degrees in (-180, 180], of a rotation (3, 3): the inverse.

        Of two answers it is the one that leans and rolls less.
        """
        away = np.cross([0.0, 0.0, 1.0], self.right)
        lean = float(np.arctan2(self.down[2], self.down @ away))
        there = np.asarray(matrix, np.float64) @ self.down
        level = float(np.hypot(there[0], there[1]))
        start = float(np.arctan2(away[1], away[0]))
        found = []
        for sign in (1.0, -1.0):
            pitch = float(np.arctan2(there[2], sign * level)) - lean
            roll = float(np.arctan2(sign * there[1], sign * there[0])) - start
            roll = roll if level > 1e-9 else 0.0
            found.append((wrapped(np.degrees(pitch)), wrapped(np.degrees(roll))))
        pitch, roll = min(found, key=lambda pair: abs(pair[0]) + abs(pair[1]))
        spun = self.carried(pitch, roll).T @ matrix
        yaw = turn_about(vector_from_matrix(spun), self.down)
        return wrapped(np.degrees(yaw)), pitch, roll


def wrapped(degrees: float) -> float:
    """Return the same direction in (-180, 180] degrees."""
    return float(180.0 - (180.0 - degrees) % 360.0)


CAMERA_GIMBAL = Gimbal(np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
