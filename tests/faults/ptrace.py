"""What of Linux's ptrace and seccomp is needed to stand between a process and the system.

Linux on x86-64. https://man7.org/linux/man-pages/man2/seccomp.2.html, .../ptrace.2.html
"""

from __future__ import annotations

import ctypes
import errno
import os
import struct

TRACEME, CONT, SETREGS, GETREGS, SETOPTIONS = 0, 7, 13, 12, 0x4200
# EXITKILL, SECCOMP, EXEC, CLONE, VFORK, FORK
OPTIONS = 0x100000 | 0x80 | 0x10 | 0x08 | 0x04 | 0x02
SECCOMP_STOP = 7  # PTRACE_EVENT_SECCOMP
ALL_CHILDREN = 0x40000000  # __WALL: threads, too
WORD = (1 << 64) - 1
_ALLOW, _TRACE = 0x7FFF0000, 0x7FF00000
_LOAD, _EQUAL, _RETURN = 0x20, 0x15, 6  # BPF
_NUMBER = 0  # byte in seccomp_data
_REGISTERS = (
    "r15", "r14", "r13", "r12", "rbp", "rbx", "r11", "r10", "r9", "r8", "rax", "rcx", "rdx", "rsi",
    "rdi", "orig_rax", "rip", "cs", "eflags", "rsp", "ss", "fs_base", "gs_base", "ds", "es", "fs",
    "gs",
)  # fmt: skip


class Registers(ctypes.Structure):
    """user_regs_struct: the call's number in `orig_rax`, its arguments in rdi, rsi, rdx, r10."""

    _fields_ = [(name, ctypes.c_ulonglong) for name in _REGISTERS]


def stop_at(numbers: list[int]) -> None:
    """From now on the kernel stops this process, and what it starts, before these calls."""
    code = [struct.pack("<HBBI", _LOAD, 0, 0, _NUMBER)]
    for k, number in enumerate(sorted(numbers)):
        code.append(struct.pack("<HBBI", _EQUAL, len(numbers) - k, 0, number))  # to the end
    code += [
        struct.pack("<HBBI", _RETURN, 0, 0, _ALLOW),
        struct.pack("<HBBI", _RETURN, 0, 0, _TRACE),
    ]
    program = ctypes.create_string_buffer(b"".join(code))
    header = struct.pack("<HxxxxxxQ", len(code), ctypes.addressof(program))
    own = libc()
    if own.prctl(38, 1, 0, 0, 0) or own.prctl(22, 2, ctypes.c_char_p(header), 0, 0):
        raise OSError(ctypes.get_errno(), "the kernel takes no filter")


def registers_of(who: int) -> Registers:
    """Of a thread that is stopped."""
    registers = Registers()
    request(GETREGS, who, ctypes.addressof(registers))
    return registers


def answer_with(who: int, registers: Registers, error: int) -> None:
    """The call that is about to be made fails with this errno, unmade."""
    registers.orig_rax = WORD  # no call
    registers.rax = -error & WORD
    set_registers(who, registers)


def set_registers(who: int, registers: Registers) -> None:
    """Of a thread that is stopped."""
    request(SETREGS, who, ctypes.addressof(registers))


def memory(who: int, address: int, size: int) -> bytes:
    """So many bytes of the process's, or fewer where its memory ends."""
    with open(f"/proc/{who}/mem", "rb", buffering=0) as file:
        parts: list[bytes] = []
        while size > 0:
            step = min(size, 4096 - address % 4096)
            try:
                file.seek(address)
                parts.append(file.read(step) or b"")
            except OSError:
                break
            address, size = address + step, size - step
    return b"".join(parts)


def libc() -> ctypes.CDLL:
    own = ctypes.CDLL(None, use_errno=True)
    own.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
    own.ptrace.restype = ctypes.c_long
    return own


def request(what: int, who: int, data: int) -> None:
    """Raises OSError, unless the process was killed meanwhile."""
    if libc().ptrace(what, who, None, data) < 0:
        number = ctypes.get_errno()
        if number != errno.ESRCH:
            raise OSError(number, os.strerror(number))
