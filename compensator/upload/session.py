"""One session with a controller: the challenge tells the dialect, the cookie is kept, it is always logged out.

Every request has a connection of its own, so no byte of an earlier one can reach it. Waits, sizes and repetitions are bounded;
only what may be done twice without harm is repeated. Neither proxies nor password files of the environment are used.
"""

from __future__ import annotations

import ssl
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost, State, refusal
from compensator.upload.deadline import Deadline
from compensator.upload.dialects import RWS_1, RWS_2, Dialect
from identification.common.findings import Finding, Refused

if TYPE_CHECKING:
    import httpx

MOST_BYTES = 64 << 20           # of a module; answers other than files are far smaller
MOST_ANSWER = 4 << 20
FIRST_PAUSE_S = 0.2
# RobotWare answers 503 to more than 20 requests a second (docs/rws.md).
LEAST_INTERVAL_S = 0.06
# A file has this rate at least, beside the time for an answer [bytes/s].
LEAST_RATE = 64 << 10
PASSING = (500, 502, 503, 504)
# What HTTPX raises at a digest challenge that it does not know: another algorithm, another quality of protection.
NO_DIGEST = (KeyError, NotImplementedError)
NO_END = "an answer that does not come to its end"


@dataclass(frozen=True)
class Reply:
    """A whole answer below 300."""

    status: int
    body: bytes


class Session:
    """A context manager: asks for the challenge when it opens, logs out when it closes. logged_out: whether that was confirmed.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.dialect: Dialect = RWS_1
        self.logged_out = True
        self._cookies: dict[str, str] = {}
        self._auth: httpx.Auth | None = None
        self._asked = ""
        self._last = 0.0
        self._client = self._opened()

    def _opened(self) -> httpx.Client:
        import httpx

        from compensator.upload.bounded import Bounded

        controller = self.controller
        transport = httpx.HTTPTransport(verify=controller.context() if controller.tls else True, trust_env=False,
                                        limits=httpx.Limits(max_connections=1, max_keepalive_connections=0))
        return httpx.Client(
            base_url=controller.url, transport=Bounded(transport), trust_env=False,
            follow_redirects=False, timeout=controller.timeout_s,
            headers={"User-Agent": "compstiff", "Accept-Encoding": "identity"})

    def __enter__(self) -> Session:
        """Raises Lost; Refused: CS6107 the certificate, CS6108 nothing that speaks RWS."""
        try:
            self._challenge()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._logout()
        finally:
            self._client.close()

    def _challenge(self) -> None:
        """Asks without a password and takes the dialect from what is asked for: digest is RWS 1.0, basic RWS 2.0."""
        import httpx

        try:
            self._repeated("GET", "/rw/system", {"Accept": RWS_2.accept}, b"", MOST_ANSWER)
            asked = ""
        except Answered as answer:
            if answer.status != 401:
                raise _no_rws(self.controller, f"the answer is {answer}") from answer
            asked = self._asked.lower()
        if asked.startswith("digest "):
            self._auth = httpx.DigestAuth(self.controller.user, self.controller.password)
        elif asked.startswith("basic "):
            if not self.controller.tls:
                raise _no_rws(self.controller, "it asks for the password in clear text, over a connection without TLS")
            self.dialect = RWS_2
            self._auth = httpx.BasicAuth(self.controller.user, self.controller.password)
        else:
            raise _no_rws(self.controller, "it asks for no password" if not asked else f"it asks for '{asked.split()[0]}'")

    def states(self, path: str) -> list[State]:
        """GET of a resource, as its states. Raises Lost, Answered."""
        query = self.dialect.query
        for attempt in range(self.controller.retries + 1):
            body = self._ask("GET", f"{path}{'&' if '?' in path else '?'}{query}" if query else path, repeat=True).body
            try:
                return self.dialect.states(body)
            except Lost:
                if attempt == self.controller.retries:
                    raise
        raise AssertionError

    def download(self, path: str) -> bytes:
        """GET of a file. Raises Lost, Answered."""
        return self._ask("GET", path, repeat=True, most=MOST_BYTES).body

    def send(self, path: str, content: bytes) -> None:
        """PUT of a file: the same content under the same name may come twice. Raises Lost, Answered."""
        self._ask("PUT", path, content, self.dialect.file_type, repeat=True)

    def delete(self, path: str) -> None:
        """DELETE of a file; one that is not there is deleted. Raises Lost, Answered."""
        try:
            self._ask("DELETE", path, b"", self.dialect.form_type, repeat=True)
        except Answered as answer:
            if answer.status != 404:
                raise

    def post(self, path: str, form: dict[str, str], *, repeat: bool = False) -> None:
        """POST of a form: repeated only where the caller knows that it does no harm. Raises Lost, Answered."""
        self._ask("POST", path, urlencode(form).encode(), self.dialect.form_type, repeat=repeat)

    def _ask(self, method: str, path: str, content: bytes = b"", kind: str = "", *, repeat: bool,
             most: int = MOST_ANSWER) -> Reply:
        headers = {"Accept": self.dialect.accept, **({"Content-Type": kind} if kind else {})}
        return self._repeated(method, path, headers, content, most, 1 + self.controller.retries if repeat else 1)

    def _repeated(self, method: str, path: str, headers: dict[str, str], content: bytes, most: int,
                  attempts: int | None = None) -> Reply:
        """The first sound answer. An answer of the kind that passes (busy, an inner error) is asked again like a lost one."""
        failure: Exception = Lost("not tried")
        for attempt in range(attempts or 1 + self.controller.retries):
            if attempt:
                time.sleep(FIRST_PAUSE_S * 2 ** (attempt - 1))
            try:
                return self._once(method, path, headers, content, most)
            except Lost as lost:
                failure = lost
            except Answered as answer:
                if answer.status not in PASSING:
                    raise
                failure = answer
        raise failure

    def _once(self, method: str, path: str, headers: dict[str, str], content: bytes, most: int) -> Reply:
        import httpx

        from compensator.upload.bounded import MOST

        time.sleep(max(self._last + LEAST_INTERVAL_S - time.monotonic(), 0.0))
        self._last = time.monotonic()
        if self._cookies:
            headers = {**headers, "Cookie": "; ".join(f"{name}={value}" for name, value in self._cookies.items())}
        deadline = Deadline(self.controller.timeout_s + len(content) / LEAST_RATE)
        try:
            with deadline, self._client.stream(
                method, path, headers=headers, content=content, auth=self._auth,
                extensions={"trace": deadline.trace, MOST: most},
            ) as response:
                self._keep(response)
                body = bytearray()
                for part in response.iter_raw():
                    body += part
                    deadline.later(len(part) / LEAST_RATE)
            if deadline.over:
                raise Lost(NO_END)
        except (httpx.HTTPError, httpx.InvalidURL, httpx.StreamError, OSError, ValueError, *NO_DIGEST) as reason:
            if self.controller.tls and _about_certificate(reason):
                raise _not_trusted(self.controller, reason) from reason
            raise Lost(NO_END if deadline.over else _why(reason)) from reason
        finally:
            self._client.cookies.clear()
        if response.status_code >= 300:
            raise refusal(response.status_code, bytes(body))
        return Reply(response.status_code, bytes(body))

    def _keep(self, response: httpx.Response) -> None:
        """Cookies belong to this one controller whatever domain they name, and go with every further request."""
        self._asked = response.headers.get("WWW-Authenticate", "")
        for answer in (*response.history, response):
            for cookie in answer.headers.get_list("Set-Cookie"):
                name, equals, value = cookie.partition(";")[0].partition("=")
                if equals and name.strip():
                    self._cookies[name.strip()] = value.strip()

    def _logout(self) -> None:
        """Ends the session: the controller has room for a bounded number of them."""
        if not self._cookies:
            return
        try:
            self._ask("GET", "/logout", repeat=True)
        except (Lost, Answered, Refused):
            self.logged_out = False
        self._cookies.clear()


def _why(reason: Exception) -> str:
    """Why there was no answer, in the words of the system where it has some."""
    import httpx

    if isinstance(reason, httpx.TimeoutException):
        return "timed out"
    if isinstance(reason, NO_DIGEST):
        return "it asks for a digest that is not known here"
    return str(reason).strip() or type(reason).__name__


def _about_certificate(reason: BaseException | None) -> bool:
    while reason is not None:
        if isinstance(reason, ssl.SSLCertVerificationError):
            return True
        reason = reason.__cause__ or reason.__context__
    return False


def _not_trusted(controller: Controller, reason: Exception) -> Refused:
    shown = controller.shown_fingerprint()
    hint = ("read the SHA-256 of the controller's certificate at the controller itself; if it is the one shown here, write "
            f"controller: {{fingerprint: \"{shown}\"}} into cell.yaml" if shown
            else "give controller.ca or controller.fingerprint")
    return Refused(Finding("CS6107", "error", f"the certificate that {controller.url} shows is not trusted ({_why(reason)}); "
                           "no password was sent", hint=hint))


def _no_rws(controller: Controller, found: str) -> Refused:
    return Refused(Finding("CS6108", "error", f"{controller.url} does not ask for a login as Robot Web Services do: {found}; "
                           "no password was sent", hint="an IRC5 (RobotWare 6) needs controller: {tls: false}, port 80; an "
                           "OmniCore (RobotWare 7) TLS, port 443"))
