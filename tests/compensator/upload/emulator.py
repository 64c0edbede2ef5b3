"""A robot controller's web services as docs/rws.md describes them, RWS 1.0 and RWS 2.0: files, tasks, mastership, sessions.

Written from the vendor's pages and from answers that others recorded, without a line of the client: logins are worked out
here, bodies are strings put together here. It is stricter than a controller where the client must not rely on more.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import html
import json
import re
import secrets
import ssl
import threading
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit

USER, PASSWORD, REALM = "Default User", "rob otics:ä", "validusers@robapi.abb"
GONE, HELD, NO_FILE = -1073445880, -1073445862, -1073414146


@dataclass
class RobotController:
    """What the controller holds. files: by path from the root ($HOME or HOME); tasks: execution state and modules of each;
    holder: the session that has mastership, "other" for somebody else; a logout alone does not give it back. log: every
    request below its login; executing: what the controller as a whole says. sick: statuses with which the next requests to a
    resource, with its query or without, are answered; 200: as if it were done; 0: as they are."""

    generation: int = 1
    files: dict[str, bytes] = field(default_factory=dict)
    folders: set[str] = field(default_factory=lambda: {"HOME", "HOME/milling"})
    tasks: dict[str, dict] = field(default_factory=lambda: {
        "T_ROB1": {"excstate": "ready", "modules": {"BASE": b"", "user": b""}},
        "T_BCK": {"excstate": "started", "modules": {}}})
    executing: str = "stopped"
    holder: str | None = None
    sessions: set[str] = field(default_factory=set)
    most_sessions: int = 70
    log: list[tuple[str, str]] = field(default_factory=list)
    logins: list[str] = field(default_factory=list)
    robotware: str = ""
    system: str = "6660-500123"
    sick: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    cookie_domain: str = "domain=robot.plant; "      # not the host that was asked: the client must keep the cookie all the same

    def __post_init__(self) -> None:
        self.robotware = self.robotware or ("6.15.1045" if self.generation == 1 else "7.21.0+229")
        self.lock = threading.RLock()

    def loaded(self, task: str = "T_ROB1") -> dict[str, bytes]:
        return self.tasks[task]["modules"]


class Emulator:
    """Serves a controller on a port of 127.0.0.1 until it is left. tls: a server context."""

    def __init__(self, controller: RobotController, tls: ssl.SSLContext | None = None) -> None:
        handler = type("Bound", (_Handler,), {"controller": controller})
        self.server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self.server.daemon_threads = True
        if tls:
            self.server.socket = tls.wrap_socket(self.server.socket, server_side=True, do_handshake_on_connect=False)
        self.port = self.server.server_address[1]
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True)

    def __enter__(self) -> Emulator:
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.server.shutdown()
        self.server.server_close()
        self.thread.join(5)


class _Refused(Exception):
    def __init__(self, status: int, code: int, message: str) -> None:
        self.status, self.code, self.message = status, code, message


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    controller: RobotController
    timeout = 10
    # In one piece and at once: of two pieces the second waits for the first to be acknowledged, 40 ms.
    wbufsize, disable_nagle_algorithm = -1, True

    def log_message(self, *_: object) -> None:
        return

    def handle(self) -> None:
        with contextlib.suppress(OSError, ssl.SSLError):
            super().handle()

    def finish(self) -> None:
        with contextlib.suppress(OSError):
            super().finish()

    # --- login ---------------------------------------------------------------------------------------------------------

    def _session(self) -> str:
        match = re.search(r"-http-session-=([^;]+)", self.headers.get("Cookie", ""))
        return match[1] if match and match[1] in self.controller.sessions else ""

    def _logged_in(self) -> bool:
        kind, _, given = self.headers.get("Authorization", "").partition(" ")
        self.controller.logins.append(kind)
        if self.controller.generation == 2:
            return kind.lower() == "basic" and base64.b64decode(given).decode() == f"{USER}:{PASSWORD}"
        if kind.lower() != "digest":
            return False
        fields = {name: quoted or plain for name, quoted, plain in re.findall(r'(\w+)=(?:"([^"]*)"|([^",\s]+))', given)}

        if not {"nonce", "nc", "cnonce", "uri", "response", "username"} <= fields.keys():
            return False

        def md5(text: str) -> str:
            return hashlib.md5(text.encode()).hexdigest()

        expected = md5(":".join([md5(f"{USER}:{REALM}:{PASSWORD}"), fields["nonce"], fields["nc"], fields["cnonce"], "auth",
                                 md5(f"{self.command}:{self.path}")]))
        return fields["uri"] == self.path and fields["username"] == USER and fields["response"] == expected

    def _challenge(self) -> None:
        asked = (f'Digest realm="{REALM}", domain="127.0.0.1:80", nonce="{secrets.token_hex(16)}", algorithm=MD5, qop="auth", '
                 f'opaque="{secrets.token_hex(8)}"' if self.controller.generation == 1 else f'Basic realm="{REALM}"')
        self._answer(401, b"", "text/html", {"WWW-Authenticate": asked})

    # --- answers -------------------------------------------------------------------------------------------------------

    def _answer(self, status: int, body: bytes = b"", kind: str = "", more: dict[str, str] | None = None) -> None:
        self.send_response(status)
        for name, value in (more or {}).items():
            self.send_header(name, value)
        for cookie in self.cookies:
            self.send_header("Set-Cookie", cookie)
        if kind:
            self.send_header("Content-Type", kind)
        if status != 204:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if status != 204:
            self.wfile.write(body)

    def _states(self, states: list[dict[str, str]]) -> None:
        if self.controller.generation == 1:
            if "json=1" not in self.path:
                raise _Refused(400, -1, "the tests read JSON only")
            document = {"_links": {"base": {"href": "http://127.0.0.1/"}}, "_embedded": {"_state": states}}
            self._answer(200, json.dumps(document).encode(), "application/json")
            return
        items = "".join(
            f'<li class="{state["_type"]}" title="{html.escape(state["_title"])}"><a href="x" rel="self"></a>' + "".join(
                f'<span class="{key}">{html.escape(value)}</span>' for key, value in state.items() if key[0] != "_") + "</li>"
            for state in states)
        self._answer(200, (
            '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml"><head><title>rapid</title><base '
            f'href="https://127.0.0.1/"/></head><body><div class="state"><ul>{items}</ul></div></body></html>').encode(),
            "application/xhtml+xml;v=2.0")

    def _refuse(self, refused: _Refused) -> None:
        message = f"rws_resource.cpp[593] {refused.message} code:{refused.code} icode:-1"
        if self.controller.generation == 1 and "json=1" in self.path:
            body = json.dumps({"_embedded": {"status": {"code": refused.code, "msg": message}, "_state": []}}).encode()
            self._answer(refused.status, body, "application/json")
        else:
            self._answer(refused.status, (
                '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml"><head><base href="x"/></head>'
                f'<body><div class="status"><span class="code">{refused.code}</span><span class="msg">{html.escape(message)}'
                "</span></div></body></html>").encode(), "application/xhtml+xml;v=2.0")

    # --- requests ------------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        controller, self.cookies = self.controller, []
        path = urlsplit(self.path).path
        wanted = int(self.headers.get("Content-Length", 0))
        body = b""
        with contextlib.suppress(OSError):
            body = self.rfile.read(wanted)
        with controller.lock:
            if not self._logged_in():
                self._challenge()
                return
            session = self._session()
            if not session:
                if len(controller.sessions) >= controller.most_sessions:
                    self._answer(503)
                    return
                session = secrets.token_hex(8)
                controller.sessions.add(session)
                self.cookies = [f"-http-session-={session}; path=/; {controller.cookie_domain}httponly",
                                "ABBCX=29; path=/; secure"]
            controller.log.append((self.command, unquote(self.path)))
            asked = unquote(path), unquote(self.path)
            if statuses := next(filter(None, (controller.sick.get((self.command, one)) for one in asked)), None):
                status = statuses.pop(0)
                if status:
                    self._refuse(_Refused(status, -1073414144, "out of order"))
                    return
            try:
                if len(body) < wanted and self.command != "PUT":
                    self.close_connection = True
                    return
                self._do(path, body, session, torn=len(body) < wanted)
            except _Refused as refused:
                self._refuse(refused)

    do_GET = do_POST = do_PUT = do_DELETE = _run

    def _do(self, path: str, body: bytes, session: str, *, torn: bool) -> None:
        controller = self.controller
        if controller.generation == 2:
            if "application/xhtml+xml;v=2.0" not in self.headers.get("Accept", ""):
                raise _Refused(406, -1, "not acceptable")
            if self.command != "GET" and ";v=2.0" not in self.headers.get("Content-Type", ""):
                raise _Refused(415, -1, "use text/plain;v=2.0 or application/octet-stream;v=2.0")
        form = {key: values[0] for key, values in parse_qs(body.decode("latin-1")).items()} if self.command == "POST" else {}
        query = {key: values[0] for key, values in parse_qs(urlsplit(self.path).query).items()}
        if path == "/logout":
            controller.sessions.discard(session)
            self._answer(200, b"<html></html>", "text/html")
        elif path.startswith("/fileservice/"):
            self._file(unquote(path.removeprefix("/fileservice/")), body, form, torn)
        elif path == "/rw/system":
            self._states([{"_type": "sys-system", "_title": "system", "name": controller.system,
                           "rwversion": controller.robotware, "sysid": "{0}"},
                          {"_type": "sys-options", "_title": "options", "option": "616-1 PC Interface"}])
        elif path.startswith("/rw/mastership/"):
            self._mastership(path, query, session)
        else:
            self._rapid(path, query, form, session)

    def _file(self, path: str, body: bytes, form: dict[str, str], torn: bool) -> None:
        controller = self.controller
        if controller.generation == 1:
            if not path.startswith("$"):
                raise _Refused(404, NO_FILE, "Resource does not exist")
            path = path[1:]
        action = form.get("fs-action", "")
        if controller.generation == 2 and self.command == "POST":
            path, _, action = path.rpartition("/")
        if self.command == "GET" and path in controller.folders:
            inside = [name for name in controller.files if name.rpartition("/")[0] == path]
            self._states([{"_type": "fs-dir", "_title": "milling", "fs-mdate": "2026-01-01 T 10:00:00"}, *(
                {"_type": "fs-file", "_title": name.rpartition("/")[2], "fs-size": str(len(controller.files[name])),
                 "fs-mdate": "2026-01-01 T 10:00:00", "fs-readonly": "false"} for name in inside)])
            return
        if self.command == "PUT":
            if path.rpartition("/")[0] not in controller.folders:
                raise _Refused(404, NO_FILE, "Path does not exist")
            new = path not in controller.files
            controller.files[path] = body           # what came, also where the connection broke off
            if torn:
                self.close_connection = True
                return
            self._answer(201 if new else 200)
            return
        if path not in controller.files:
            raise _Refused(404, NO_FILE, "Resource does not exist")
        if self.command == "GET":
            self._answer(200, controller.files[path], "application/octet-stream")
        elif self.command == "DELETE":
            del controller.files[path]
            self._answer(204)
        elif action == "rename" and re.fullmatch(r"[\w.-]+", form.get("fs-newname", "")):
            target = f"{path.rpartition('/')[0]}/{form['fs-newname']}"
            if target in controller.files:
                raise _Refused(400, -1073414145, "Resource exists")
            controller.files[target] = controller.files.pop(path)
            self._answer(204)
        else:
            raise _Refused(400, -1073438708, "Invalid/No Query Parameter")

    def _mastership(self, path: str, query: dict[str, str], session: str) -> None:
        controller = self.controller
        domain, _, action = path.removeprefix("/rw/mastership/").partition("/")
        action = action or query.get("action", "")
        if int(controller.robotware.partition(".")[0]) >= 8:
            raise _Refused(410, GONE, "gone")
        if self.command != "POST" or domain != ("rapid" if controller.generation == 1 else "edit"):
            raise _Refused(404, GONE, "no such domain")
        if action == "request":
            if controller.holder not in (None, session):
                raise _Refused(403, HELD, "Requested resource is held by someone else")
            controller.holder = session
        elif action == "release" and controller.holder == session:
            controller.holder = None
        else:
            raise _Refused(403, -1073445859, "Operation not allowed for current mastership state")
        self._answer(204)

    def _rapid(self, path: str, query: dict[str, str], form: dict[str, str], session: str) -> None:
        controller, first = self.controller, self.controller.generation == 1
        if self.command == "GET" and path == "/rw/rapid/execution":
            self._states([{"_type": "rap-execution", "_title": "execution", "ctrlexecstate": controller.executing,
                           "cycle": "forever"}])
        elif self.command == "GET" and path == "/rw/rapid/tasks":
            self._states([{"_type": "rap-task-li", "_title": name, "name": name, "type": "normal", "taskstate": "linked",
                           "excstate": task["excstate"], "active": "On", "motiontask": "TRUE"}
                          for name, task in controller.tasks.items()])
        elif self.command == "GET" and path.endswith("/modules"):
            task = query.get("task", "") if first else path.split("/")[4]
            if first != (path == "/rw/rapid/modules") or task not in controller.tasks:
                raise _Refused(400, -1073442813, "task parameter is invalid or missing")
            self._states([{"_type": "rap-module-info-li", "_title": name, "name": name, "type": "ProgMod"}
                          for name in controller.tasks[task]["modules"]])
        elif self.command == "POST" and (match := re.fullmatch(
                r"/rw/rapid/tasks/(\w+)" if first else r"/rw/rapid/tasks/(\w+)/loadmod", path)) and (
                not first or query.get("action") == "loadmod"):
            self._load(match[1], form, session)
        else:
            raise _Refused(404, NO_FILE, "no such resource")

    def _load(self, task: str, form: dict[str, str], session: str) -> None:
        controller = self.controller
        if controller.holder != session:
            raise _Refused(403, -1073445859, "Operation not allowed for current mastership state")
        root = "$" if controller.generation == 1 else ""
        content = controller.files.get(form.get("modulepath", "").removeprefix(root))
        name = re.search(rb"^\s*MODULE\s+(\w+)", content or b"", re.M)
        if name is None or not form.get("modulepath", "").startswith(root):
            raise _Refused(400, -1073442813, "module path is invalid")
        modules = controller.tasks[task]["modules"]
        if name[1].decode() in modules and form.get("replace") != "true":
            raise _Refused(400, -1073442811, "module already loaded")
        modules[name[1].decode()] = content
        self._answer(204)
