"""VISA library of the simulated bench: PyVISA-sim's, with functions of VISA that it lacks, and timeouts on the instruments' clock."""

from __future__ import annotations

from typing import SupportsInt, cast

import numpy as np
import pyvisa
from pyvisa import constants
from pyvisa.typing import VISAEventContext, VISARMSession, VISASession
from pyvisa_sim.devices import Device, Devices
from pyvisa_sim.highlevel import SimVisaLibrary

from motoremi.virtual.simulated_device import SimulatedDevice


class BenchLibrary(SimVisaLibrary):
    """PyVISA-sim's library with device clear, serial poll and service requests; opening an unknown resource is an error."""

    devices: Devices

    def _init(self) -> None:
        self.sessions = {}
        self.devices = Devices()
        # Session -> number of its instrument's service requests that a client has already received.
        self._seen: dict[VISASession, int] = {}

    def add(self, resource_name: str, device: SimulatedDevice) -> None:
        """Connect an instrument under that name."""
        # Of a device, PyVISA-sim uses `write` and `resource_name` alone, since `read` is overridden below.
        self.devices.add_device(resource_name, cast(Device, device))

    def open(
        self,
        session: VISARMSession,
        resource_name: str,
        access_mode: constants.AccessModes = constants.AccessModes.no_lock,
        open_timeout: SupportsInt = constants.VI_TMO_IMMEDIATE,
    ) -> tuple[VISASession, constants.StatusCode]:
        """Open a session; an unknown resource is an error, as on a real bus."""
        opened, status = super().open(session, resource_name, access_mode, open_timeout)
        if status != constants.StatusCode.success:
            raise pyvisa.VisaIOError(status)
        return opened, status

    def read(self, session: VISASession, count: int) -> tuple[bytes, constants.StatusCode]:
        """Read from an instrument; the timeout is on the instrument's clock, so that it takes no real time if that clock is virtual."""
        link, device = self.sessions[session], self.device_on(session)
        if link.parsed.interface_type_const == constants.InterfaceType.asrl:
            return self._read_line(session, count)
        timeout_s = link.get_attribute(constants.ResourceAttribute.timeout_value)[0] / 1000
        wait_s = device.answer_due_s - device.clock.now() if device.answers else np.inf
        if wait_s > timeout_s:
            device.clock.sleep(timeout_s)
            raise pyvisa.VisaIOError(constants.VI_ERROR_TMO)
        device.clock.sleep(wait_s)
        message = device.answers[0]
        part = bytes(message[:count])
        del message[:count]
        if message:
            return part, constants.StatusCode.success_max_count_read
        device.answers.popleft()
        return part, constants.StatusCode.success

    def _read_line(self, session: VISASession, count: int) -> tuple[bytes, constants.StatusCode]:
        """Read from a serial line up to the termination character, or `count` bytes if none is enabled."""
        link, device = self.sessions[session], self.device_on(session)
        waiting = device.take_answers()
        if link.get_attribute(constants.ResourceAttribute.termchar_enabled)[0]:
            end = waiting.find(bytes([link.get_attribute(constants.ResourceAttribute.termchar)[0]])) + 1
        else:
            end = count if len(waiting) >= count else 0
        wait_s = device.answer_due_s - device.clock.now() if end else np.inf
        timeout_s = link.get_attribute(constants.ResourceAttribute.timeout_value)[0] / 1000
        device.clock.sleep(min(wait_s, timeout_s))
        part = waiting[: min(end, count)] if wait_s <= timeout_s else b""
        device.answers.append(bytearray(waiting[len(part) :]))
        if not part:
            raise pyvisa.VisaIOError(constants.VI_ERROR_TMO)
        ended = len(part) == end
        return part, constants.StatusCode.success_termination_character_read if ended else constants.StatusCode.success_max_count_read

    def clear(self, session: VISASession) -> constants.StatusCode:
        """Device clear."""
        self.device_on(session).device_clear()
        return constants.StatusCode.success

    def flush(self, session: VISASession, mask: constants.BufferOperation) -> constants.StatusCode:
        """Discard the buffers of a serial line."""
        self.device_on(session).device_clear()
        return constants.StatusCode.success

    def read_stb(self, session: VISASession) -> tuple[int, constants.StatusCode]:
        """Serial poll."""
        return self.device_on(session).serial_poll(), constants.StatusCode.success

    def enable_event(
        self, session: VISASession, event_type: constants.EventType, mechanism: constants.EventMechanism, context: None = None
    ) -> constants.StatusCode:
        """Queue service requests from now on; other events do not exist, and only GPIB has service requests."""
        link = self.sessions[session]
        if event_type != constants.EventType.service_request or link.parsed.interface_type_const != constants.InterfaceType.gpib:
            raise pyvisa.VisaIOError(constants.StatusCode.error_invalid_event)
        self._seen.setdefault(session, self.device_on(session).service_requests)
        return constants.StatusCode.success

    def wait_on_event(
        self, session: VISASession, in_event_type: constants.EventType, timeout: int
    ) -> tuple[constants.EventType, VISAEventContext, constants.StatusCode]:
        """Wait for the next service request; on a virtual clock that takes no time."""
        if session not in self._seen:
            raise pyvisa.VisaIOError(constants.StatusCode.error_not_enabled)
        device = self.device_on(session)
        deadline_s = device.clock.now() + timeout / 1000
        device.notice_request()
        while device.service_requests == self._seen[session]:
            now_s = device.clock.now()
            if now_s >= deadline_s:
                raise pyvisa.VisaIOError(constants.StatusCode.error_timeout)
            ends_s = device.busy_until()
            device.clock.sleep((ends_s if now_s < ends_s < deadline_s else deadline_s) - now_s)
            device.notice_request()
        self._seen[session] += 1
        return in_event_type, VISAEventContext(0), constants.StatusCode.success

    def discard_events(self, session: VISASession, event_type: constants.EventType, mechanism: constants.EventMechanism) -> constants.StatusCode:
        """Discard the queued service requests."""
        if session in self._seen:
            self._seen[session] = self.device_on(session).service_requests
        return constants.StatusCode.success

    def disable_event(self, session: VISASession, event_type: constants.EventType, mechanism: constants.EventMechanism) -> constants.StatusCode:
        """Stop queuing service requests."""
        self._seen.pop(session, None)
        return constants.StatusCode.success

    def device_on(self, session: VISASession) -> SimulatedDevice:
        """The instrument of a session."""
        return cast(SimulatedDevice, self.sessions[session].device)
