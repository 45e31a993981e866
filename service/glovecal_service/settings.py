"""The service's settings: environment variables ``GLOVECAL_*``, each with a default that is safe alone."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal
from urllib.parse import urlsplit

from pydantic import Field, ValidationInfo, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from glovecal_client.hosts import is_loopback
from glovecal_client.site.roles import ROLES, Role
from glovecal_models.names import check_identifier
from glovecal_service.secret_files import secret_in

if TYPE_CHECKING:
    from sqlalchemy import URL


_ENDPOINT = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):[0-9]{1,5}\Z")
SQLITE_FILE = "glovecal.sqlite3"
_HOST = re.compile(r"[A-Za-z0-9._:-]+\Z")
LONGEST_ISSUER = 255
_SECRET_FILE = "GLOVECAL_OIDC_SECRET_FILE"


class Settings(BaseSettings):
    """Where data is kept, where the service listens, and how much it may take."""

    model_config = SettingsConfigDict(env_prefix="GLOVECAL_", frozen=True, extra="ignore")

    data: Path = Path("glovecal-data")
    """Folder of the database, artifacts, uploads, videos, recordings and fits."""
    database: str | None = None
    """SQLAlchemy URL, such as ``postgresql+psycopg://user@host/glovecal``; None: SQLite in ``data``."""
    artifacts: str | None = None
    """Object store URL, such as ``s3://bucket/prefix``; None: the folder ``artifacts`` in ``data``."""
    zenoh: str = "tcp/127.0.0.1:7447"
    """Endpoint of the router that the service runs."""
    zenoh_peers: str = ""
    """Endpoints of the routers of other services of the site, separated by commas: they share the gloves."""
    realtime: Annotated[int, Field(ge=1, le=64)] = 1
    """Processes that predict, each on a core of its own; they share the gloves."""
    recorders: Annotated[int, Field(ge=1, le=64)] = 1
    """Processes that record; they share the recordings."""
    site: str = "lab"
    """Second part of every zenoh key."""
    site_file: Path | None = None
    """The service's own file of a site with certificates (``glovecal site init``); None: nothing is
    encrypted, and the service listens on loopback only."""
    allowed_hosts: str = ""
    """Names and addresses that the service answers to, separated by commas; "": those of loopback and those
    in its certificate."""
    proxies: str = ""
    """Addresses and networks of reverse proxies, separated by commas: what they say of who asks, and how, is
    believed (X-Forwarded-For, X-Forwarded-Proto)."""
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8600
    login: Literal["beyond loopback", "always"] = "beyond loopback"
    """Who has to prove who they are: whoever asks a service that listens beyond loopback, or everybody."""
    workers: Annotated[int, Field(ge=0, le=256)] = 2
    """Training processes of this computer, one thread each; 0: training is left to ``glovecal worker`` on
    others."""
    worker_port: Annotated[int, Field(ge=1, le=65535)] = 8601
    """Where workers on other computers are let in, at ``host``; closed while the site has no such member."""
    workers_idle_s: Annotated[float, Field(gt=0, le=86400)] = 60.0
    """Training processes that nobody has needed for so long are ended; the next job starts them anew."""
    oidc_client_id: str = ""
    oidc_secret_file: Path | None = None
    """File with the secret that the provider gave this service; None: it gave none (a public client)."""
    oidc_claim: str = "groups"
    """The claim whose values say what somebody may do."""
    oidc_roles: Annotated[Mapping[str, Role], NoDecode] = Field(default_factory=dict)
    """Which role a value of the claim gives: ``animators=operator,leads=admin``."""
    oidc_name: str = ""
    """What the login page calls the provider; "": the host of its address."""
    oidc_issuer: Annotated[str, Field(validate_default=True)] = ""
    """Address of the provider of OpenID Connect whose people may log in; "": nobody's."""
    log_names: bool = True
    """Whether lines of the log may name people, gloves and takes."""
    studio: bool = True
    """Serve the pages below ``/studio``."""
    upload_limit_mb: Annotated[int, Field(ge=1)] = 256
    keep_days: Annotated[float, Field(gt=0, le=36500)] = 90.0
    """How long uploads that no take came from, films and ledgers of recordings that became takes are kept."""
    keep_jobs_days: Annotated[float, Field(gt=0, le=36500)] = 730.0
    """How long jobs that are over are kept with their results, but the newest of each kind and subject."""

    @field_validator("site_file", "oidc_secret_file", mode="before")
    @classmethod
    def _nothing_is_no_file(cls, file: Any) -> Any:
        return file or None

    @field_validator("allowed_hosts")
    @classmethod
    def _hosts_are_names(cls, allowed_hosts: str) -> str:
        for name in filter(None, (each.strip() for each in allowed_hosts.split(","))):
            if not _HOST.match(name):
                raise ValueError(f"{name!r} is neither the name nor the address of a computer")
        return allowed_hosts

    @field_validator("proxies")
    @classmethod
    def _proxies_are_addresses(cls, proxies: str) -> str:
        for each in filter(None, (part.strip() for part in proxies.split(","))):
            try:
                network = ipaddress.ip_network(each)
            except ValueError as error:
                raise ValueError(
                    f"{each!r} is neither the address of a proxy, such as 192.168.1.5, nor a network, such "
                    "as 172.18.0.0/16"
                ) from error
            if network.prefixlen == 0:
                raise ValueError(f"{each} is everybody: name the proxies alone")
        return proxies

    @field_validator("site")
    @classmethod
    def _site_fits_into_a_key(cls, site: str) -> str:
        return check_identifier(site, "GLOVECAL_SITE")

    @field_validator("zenoh_peers")
    @classmethod
    def _peers_are_endpoints(cls, peers: str) -> str:
        for each in filter(None, (part.strip() for part in peers.split(","))):
            if not _ENDPOINT.match(each):
                raise ValueError(f"{each!r} is no endpoint of a router, such as tls/lab-2.example:7447")
        return peers

    @field_validator("oidc_secret_file")
    @classmethod
    def _secret_can_be_read(cls, file: Path | None) -> Path | None:
        if file is not None:
            secret_in(file, _SECRET_FILE)
        return file

    @field_validator("oidc_roles", mode="before")
    @classmethod
    def _values_give_roles(cls, text: Any) -> Any:
        if not isinstance(text, str):
            return text
        roles: dict[str, Role] = {}
        for part in filter(None, (each.strip() for each in text.split(","))):
            value, _, name = (each.strip() for each in part.rpartition("="))
            role: Role | None = next((each for each in ROLES if each == name), None)
            if role is None or not value:
                raise ValueError(
                    f"{part!r} gives no role; write VALUE=ROLE, separated by commas, such as "
                    f"animators=operator,leads=admin, with the roles {', '.join(ROLES)}"
                )
            roles[value] = role
        return roles

    @field_validator("oidc_issuer")
    @classmethod
    def _provider_is_known(cls, issuer: str, info: ValidationInfo) -> str:
        """Whoever could answer in the provider's place could make themselves an admin."""
        if not issuer:
            for name in ("oidc_client_id", "oidc_secret_file", "oidc_roles", "oidc_name"):
                if info.data.get(name):
                    raise ValueError(
                        f"GLOVECAL_{name.upper()} is of no use without the address of a provider: set it, too"
                    )
            return issuer
        if not is_safe_address(issuer) or len(issuer) > LONGEST_ISSUER or {"?", "#", "@"} & set(issuer):
            raise ValueError("give the provider's address, https://HOST (http:// on this computer only)")
        for name in ("oidc_client_id", "oidc_claim", "oidc_roles"):
            if name in info.data and not info.data[name]:
                raise ValueError(f"people of that provider log in only with GLOVECAL_{name.upper()}, too")
        return issuer

    @property
    def linked_routers(self) -> list[str]:
        """Endpoints."""
        return [each.strip() for each in self.zenoh_peers.split(",") if each.strip()]

    @property
    def known_proxies(self) -> list[str]:
        """Addresses and networks."""
        return [each.strip() for each in self.proxies.split(",") if each.strip()]

    @property
    def oidc_secret(self) -> str:
        """ "" where there is none. Raises BadInput."""
        return "" if self.oidc_secret_file is None else secret_in(self.oidc_secret_file, _SECRET_FILE)

    @property
    def database_url(self) -> str | URL:
        if self.database:
            return self.database
        from sqlalchemy import URL

        # no text: "?" and "%" of a folder's name mean something else in a URL
        return URL.create("sqlite", database=str(self.data.resolve() / SQLITE_FILE))

    @property
    def artifacts_folder(self) -> Path:
        return self.data / "artifacts"

    @property
    def uploads_folder(self) -> Path:
        return self.data / "uploads"

    @property
    def videos_folder(self) -> Path:
        return self.data / "videos"

    @property
    def films_folder(self) -> Path:
        return self.data / "films"

    @property
    def recordings_folder(self) -> Path:
        return self.data / "recordings"

    @property
    def fits_folder(self) -> Path:
        return self.data / "fits"

    @property
    def upload_limit_bytes(self) -> int:
        return self.upload_limit_mb * 1_000_000


def is_safe_address(address: str) -> bool:
    """Whether nobody on the way can read or change what is exchanged with this http(s) address."""
    try:
        parts = urlsplit(address)
        host = parts.hostname or ""
    except ValueError:
        return False
    return bool(host) and (parts.scheme == "https" or (parts.scheme == "http" and is_loopback(host)))
