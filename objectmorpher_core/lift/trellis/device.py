"""On which device, in which precision, and how much stays in memory between two lifts."""

from __future__ import annotations

from dataclasses import dataclass

import torch

ROOMY = 12 << 30  # bytes of a GPU on which all parts stay: 3.5 of weights, 2 of the encoder, work


@dataclass(frozen=True)
class Plan:
    """How a generator runs."""

    device: torch.device
    dtype: torch.dtype  # of transformers and convolutions
    keeps: bool  # whether parts stay in memory for the next object

    @staticmethod
    def best() -> Plan:
        """What this machine has: CUDA (or ROCm, which calls itself so), MPS, or its processor."""
        if torch.cuda.is_available():
            roomy = torch.cuda.get_device_properties(0).total_memory >= ROOMY
            return Plan(torch.device("cuda"), torch.float16, roomy)
        if torch.backends.mps.is_available():
            return Plan(torch.device("mps"), torch.float16, False)
        return Plan(torch.device("cpu"), torch.float32, False)

    def thrifty(self) -> Plan:
        """The same with one part in memory at a time."""
        return Plan(self.device, self.dtype, False)

    def empty_cache(self) -> None:
        """Gives what torch holds for later back to the device."""
        if self.device.type == "cuda":
            torch.cuda.empty_cache()
        elif self.device.type == "mps":
            torch.mps.empty_cache()
