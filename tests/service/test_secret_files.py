"""Secrets in files, as container engines hand them over: taken, told to nobody, and refused by name."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import psycopg
import pytest
from postgres_server import PostgresServer

SECRET = "correct-horse-5"


def glovecal(tmp_path: Path, *words: str, **settings: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "glovecal_service.cli.command", *words]
    environment = os.environ | {"GLOVECAL_DATA": str(tmp_path / "data"), **settings}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert SECRET not in done.stdout + done.stderr
    return done


def written(tmp_path: Path, content: str, mode: int = 0o600) -> str:
    file = tmp_path / f"secret-{mode:o}"
    file.write_text(f"{content}\n")
    file.chmod(mode)
    return str(file)


@pytest.mark.needs_postgres
def test_the_password_of_the_database_comes_from_a_file(tmp_path: Path, own_postgres: PostgresServer) -> None:
    url = own_postgres.new_database().replace("postgres@/", "anna@/")
    with psycopg.connect(
        f"host={own_postgres.folder} user=postgres dbname=postgres", autocommit=True
    ) as server:
        server.execute(f"CREATE ROLE anna SUPERUSER LOGIN PASSWORD '{SECRET}'".encode())
        access = own_postgres.folder / "data" / "pg_hba.conf"
        access.write_text("local all postgres trust\nlocal all all scram-sha-256\n")
        server.execute("SELECT pg_reload_conf()")
    settings = {"GLOVECAL_DATABASE": url}
    assert glovecal(tmp_path, "subject", "list", **settings).returncode == 1
    wrong = glovecal(
        tmp_path, "subject", "list", **settings, PGPASSWORD_FILE=written(tmp_path, "wrong", 0o400)
    )
    assert wrong.returncode == 1
    right = glovecal(
        tmp_path, "subject", "add", "anna", **settings, PGPASSWORD_FILE=written(tmp_path, SECRET)
    )
    assert (right.returncode, right.stderr) == (0, "")


def test_the_whole_address_may_stand_in_one(tmp_path: Path) -> None:
    file = written(tmp_path, f"sqlite:///{tmp_path}/{SECRET}.sqlite3")
    assert glovecal(tmp_path, "subject", "add", "anna", GLOVECAL_DATABASE_FILE=file).returncode == 0
    assert (tmp_path / f"{SECRET}.sqlite3").exists()


def test_a_file_that_cannot_be_taken_is_named(tmp_path: Path) -> None:
    both = glovecal(tmp_path, "subject", "list", PGPASSWORD="a", PGPASSWORD_FILE=written(tmp_path, SECRET))
    assert both.returncode == 1
    assert "PGPASSWORD and PGPASSWORD_FILE are both set: unset one of them" in both.stderr
    missing = glovecal(tmp_path, "subject", "list", GLOVECAL_KEY_FILE=str(tmp_path / "none"))
    assert missing.returncode == 1
    assert "GLOVECAL_KEY_FILE: the file" in missing.stderr
    assert "cannot be read (No such file or directory)" in " ".join(missing.stderr.split())
    two = glovecal(tmp_path, "subject", "list", PGPASSWORD_FILE=written(tmp_path, f"{SECRET}\nmore"))
    assert "must hold the secret in one line" in " ".join(two.stderr.split())


@pytest.mark.skipif(sys.platform == "win32", reason="files have no modes there")
def test_others_may_read_it_in_an_image_only(tmp_path: Path) -> None:
    file = {"PGPASSWORD_FILE": written(tmp_path, SECRET, 0o444)}
    refused = glovecal(tmp_path, "subject", "list", **file)
    assert "PGPASSWORD_FILE: others on this computer may read it" in " ".join(refused.stderr.split())
    assert glovecal(tmp_path, "subject", "list", **file, GLOVECAL_INSTALLED_BY="image").returncode == 0
