"""Runs distributed over workers, each computed once even if workers die: a run is locked in the store meanwhile."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import ExitStack
from dataclasses import dataclass
from enum import Enum
from typing import Any, NoReturn

from anctmm.errors import SolverError
from studies.engine.running.team import SweepError, Team
from studies.engine.running.worker import Answer, Errand, NotSendable, OtherCode, work
from studies.engine.storage.store import Claim, Store

#: Runs that are out at once for each worker: one that it is at, one that it finds at hand then.
AT_HAND = 2
#: s, between two looks for runs that another session is at, and for workers that came or went.
_LOOK, _SOON = 1.0, 0.05


@dataclass(frozen=True)
class Died:
    """In place of an answer: every worker that was sent the run died of it."""

    reason: str

    def __str__(self) -> str:
        return f"a worker died during it, and another one at the second attempt: {self.reason}"

    def result(self) -> NoReturn:
        """Say so.

        Raises
        ------
        SolverError
        """
        raise SolverError(str(self))


class Elsewhere(Enum):
    """In place of an answer."""

    KEPT = "another session has computed it meanwhile"
    HERE = "it cannot be sent to a worker: the main process computes it"


Came = Answer | Died | Elsewhere


@dataclass(frozen=True)
class Wanted:
    """A run that workers shall do.

    Parameters
    ----------
    key : str
        Of its answer in the store; empty where it is not kept.
    errand : callable
        Makes it ready to be sent; may raise NotSendable.
    """

    key: str
    errand: Callable[[], Errand]


@dataclass
class _Out:
    """A run that is out."""

    number: int
    errand: Errand
    claim: Claim
    deaths: int = 0


class Spread:
    """A sweep's runs on their way.

    Parameters
    ----------
    team : Team
    store : Store
        Takes the answers.
    wanted : sequence of Wanted
        In the order in which they are sent.
    """

    def __init__(self, team: Team, store: Store, wanted: Sequence[Wanted]) -> None:
        self._team, self._store, self._wanted = team, store, wanted
        self._waiting = deque(range(len(wanted)))
        self._out: dict[Future[Any], _Out] = {}

    def __iter__(self) -> Iterator[tuple[int, Came]]:
        """Numbers of runs and what came of them, as it comes.

        Raises
        ------
        SweepError
            If the workers cannot do such runs at all.
        """
        try:
            while self._waiting or self._out:
                yield from self._send()
                soon = bool(self._waiting) and len(self._out) < self._room()
                if not self._out:
                    time.sleep(_SOON if self._waiting else 0.0)
                    continue
                done, _ = wait(self._out, _SOON if soon else _LOOK, return_when=FIRST_COMPLETED)
                for future in done:
                    yield from self._came(future)
        finally:
            with ExitStack() as every:
                for future, out in self._out.items():
                    every.callback(out.claim.close)
                    future.cancel()

    def _room(self) -> int:
        """Runs that may be out at once."""
        return AT_HAND * max(self._team.size(), 1)

    def _send(self) -> Iterator[tuple[int, Came]]:
        """Send runs while there is room; those that another session is at are looked for again later."""
        room = self._room()
        for _ in range(len(self._waiting)):
            if len(self._out) >= room:
                return
            number = self._waiting.popleft()
            wanted = self._wanted[number]
            claim = self._store.claim(wanted.key)
            if claim is None:
                self._waiting.append(number)
            elif self._store.has(wanted.key):
                claim.close()
                yield number, Elsewhere.KEPT
            else:
                try:
                    self._submit(_Out(number, wanted.errand(), claim))
                except NotSendable:
                    claim.close()
                    yield number, Elsewhere.HERE

    def _submit(self, out: _Out) -> None:
        self._out[self._team.executor.submit(work, out.errand)] = out

    def _came(self, future: "Future[Any]") -> Iterator[tuple[int, Came]]:
        """What came of a run; one whose worker died is sent again."""
        out = self._out.pop(future)
        try:
            came = self._answer(future)
        except self._team.died as error:
            out.deaths += 1
            if out.deaths < self._team.tries:
                self._submit(out)
                return
            came = Died(" ".join(str(error).split()))
        except BaseException:
            out.claim.close()
            raise
        if isinstance(came, Answer) and came.kept:
            self._store.keep(self._wanted[out.number].key, came.content)
        out.claim.close()
        yield out.number, came

    def _answer(self, future: "Future[Any]") -> Came:
        try:
            return future.result()  # type: ignore[no-any-return]
        except self._team.died:
            raise
        except NotSendable:
            return Elsewhere.HERE
        except CancelledError as error:
            raise SweepError(
                f"the sweep has lost its workers{self._team.where}; finished runs are kept"
            ) from error
        except OtherCode as error:
            raise SweepError(
                f"a worker{self._team.where} has other code: {error}; the same versions are needed"
            ) from error
        except Exception as error:
            text = " ".join(str(error).split())
            raise SweepError(
                f"a worker{self._team.where} cannot do runs: {type(error).__name__}: {text}"
            ) from error
