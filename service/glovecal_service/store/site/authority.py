"""A site's authority: the key that signs the certificates of its members, all ECDSA P-256.

Private keys are made and certificates signed with ``cryptography``: Python's own ``ssl`` can do neither.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from glovecal_client.site.member import Kind
from glovecal_models.errors import BadInput

MEMBER_DAYS = 397
AUTHORITY_DAYS = 3650
CLOCKS_APART = timedelta(hours=1)
"""A certificate is valid from before it was made: clocks of other computers may be behind."""


@dataclass(frozen=True)
class Issued:
    """A certificate with its private key, as PEM."""

    certificate: str
    private_key: str
    expires: datetime


class Authority:
    """Signs. The private key is in memory only while this lives."""

    def __init__(self, certificate: str, private_key: str) -> None:
        """From PEM. Raises BadInput where the two are not a pair."""
        try:
            self._certificate = x509.load_pem_x509_certificate(certificate.encode())
            key = serialization.load_pem_private_key(private_key.encode(), password=None)
        except (ValueError, TypeError, UnsupportedAlgorithm) as error:
            raise BadInput("the authority's certificate or key is no PEM file of a site") from error
        if (
            not isinstance(key, ec.EllipticCurvePrivateKey)
            or key.public_key() != self._certificate.public_key()
        ):
            raise BadInput(
                "the private key is not that of this site's authority; give the site's own authority.key"
            )
        self._key = key
        self.certificate = certificate

    @classmethod
    def make(cls, site: str) -> tuple[Authority, Issued]:
        """A new one for a site, and what to keep of it."""
        key = ec.generate_private_key(ec.SECP256R1())
        name = x509.Name(
            [
                x509.NameAttribute(NameOID.COMMON_NAME, f"Glovecal authority of site {site}"[:64]),
                x509.NameAttribute(
                    NameOID.ORGANIZATIONAL_UNIT_NAME, f"{x509.random_serial_number():040x}"[:16]
                ),
            ]
        )
        builder = _builder(name, name, key.public_key(), AUTHORITY_DAYS, datetime.now(UTC))
        certificate = (
            builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(signs_certificates=True), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
            .sign(key, hashes.SHA256())
        )
        kept = _issued(certificate, key)
        return cls(kept.certificate, kept.private_key), kept

    def issue(
        self,
        common_name: str,
        *,
        name: str,
        kind: Kind,
        hosts: Sequence[str] = (),
        days: int = MEMBER_DAYS,
        now: datetime | None = None,
    ) -> Issued:
        """A certificate for a member, with a new private key. ``hosts``: what it is called by."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name(
            [
                x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, name),
                x509.NameAttribute(NameOID.COMMON_NAME, common_name),
            ]
        )
        builder = _builder(
            subject, self._certificate.subject, key.public_key(), days, now or datetime.now(UTC)
        )
        certificate = (
            builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(signs_certificates=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage(_purposes(kind)), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key()), critical=False
            )
        )
        if hosts:
            names = x509.SubjectAlternativeName([general_name(host) for host in hosts])
            certificate = certificate.add_extension(names, critical=False)
        return _issued(certificate.sign(self._key, hashes.SHA256()), key)


def general_name(host: str) -> x509.GeneralName:
    """A host's name or address as it stands in a certificate. Raises BadInput."""
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError as error:
        raise BadInput(f"{host!r} is neither the name nor the address of a computer") from error


def _purposes(kind: Kind) -> list[x509.ObjectIdentifier]:
    """Only the service answers to others."""
    both = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    return both if kind == "service" else both[:1]


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, days: int, now: datetime
) -> x509.CertificateBuilder:
    begins = now - CLOCKS_APART
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begins)
        .not_valid_after(begins + timedelta(days=days))
    )


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _issued(certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> Issued:
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return Issued(
        certificate.public_bytes(serialization.Encoding.PEM).decode(),
        private.decode(),
        certificate.not_valid_after_utc,
    )
