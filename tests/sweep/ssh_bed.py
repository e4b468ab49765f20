"""A real sshd on loopback, as a test bed: the hosts `lab1` and `lab2` are both this computer, reached by ssh.

    with SshBed(folder) as ssh:
        subprocess.run(["parallel", "--sshlogin", ssh.logins, …], env=ssh.environment())

Keys, port, settings and log are its own, in the folder. Nothing is installed. As root, sshd demands a user and a folder that
the package would make: it gets them in a mount namespace, as whose root it runs; the rest of the system sees neither.
"""

import getpass
import os
import pathlib
import pwd
import signal
import subprocess

from unpacked import environment, free_ports, kill_all_with, program, start, wait_until

HOSTS = ("lab1", "lab2")
SERVER = """\
ListenAddress 127.0.0.1:{port}
HostKey {folder}/host_key
AuthorizedKeysFile {folder}/user_key.pub
AuthenticationMethods publickey
PermitRootLogin yes
StrictModes no
PidFile none
MaxStartups 100
SetEnv {variables}
Subsystem sftp internal-sftp
"""
CLIENT = """\
Host {hosts}
  HostName 127.0.0.1
  Port {port}
  User {user}
  IdentityFile {folder}/user_key
  IdentitiesOnly yes
  UserKnownHostsFile {folder}/known_hosts
  GlobalKnownHostsFile none
  LogLevel ERROR
  BatchMode yes
"""
# What root's sshd needs: /run/sshd, and the user sshd. In /etc/shadow no account is locked.
AS_ROOT = """\
mount --bind passwd /etc/passwd && mount --bind shadow /etc/shadow || exit
[ -d /run/sshd ] || { mount -t tmpfs tmpfs /run && mkdir -m 755 /run/sshd; } || exit
exec "$@"
"""


class SshBed:
    hosts = HOSTS
    logins = ",".join(HOSTS)

    def __init__(self, folder):
        self.folder = pathlib.Path(folder).resolve()
        self.process = None

    def __enter__(self):
        (port,) = free_ports(1)
        self._write_settings(port)
        try:
            self.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        """Ends the server and all that was started through it."""
        self.kill()

    def environment(self):
        """Of ssh's callers: PARALLEL_SSH is what GNU parallel and rsync take for ssh."""
        return {**environment(), "PARALLEL_SSH": self.ssh, "RSYNC_RSH": self.ssh,
                "PARALLEL_HOME": str(self.folder / "parallel")}

    @property
    def ssh(self):
        """The command that knows the hosts."""
        return f"{program('ssh')} -F {self.folder}/config"

    def start(self):
        """Also after a kill: with the same port and keys."""
        command = [program("sshd"), "-D", "-e", "-f", str(self.folder / "sshd_config")]
        if os.geteuid() == 0:
            command = ["unshare", "--mount", "sh", "-c", AS_ROOT, "sh", *command]
        self.process = start(command, self.folder / "sshd.log", self.folder,
                             {**environment(), "SSH_BED": str(self.folder)})
        wait_until(self.answers, "sshd")

    def answers(self):
        """Whether a host runs a command."""
        return subprocess.run([*self.ssh.split(), HOSTS[0], "true"], capture_output=True).returncode == 0

    def kill(self):
        """As by a loss of power of all hosts."""
        if self.process:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()
        kill_all_with(SSH_BED=str(self.folder))

    def _variables(self):
        """Of what runs on the hosts."""
        return {**{name: environment()[name] for name in ("PATH", "LD_LIBRARY_PATH")}, "SSH_BED": self.folder}

    def _write_settings(self, port):
        self.folder.mkdir(parents=True, exist_ok=True)
        for name in ("host_key", "user_key"):
            subprocess.run([program("ssh-keygen"), "-q", "-t", "ed25519", "-N", "", "-f", self.folder / name], check=True)
        key = (self.folder / "host_key.pub").read_text()
        known = {"folder": self.folder, "port": port, "user": getpass.getuser(), "hosts": " ".join(HOSTS),
                 "variables": " ".join(f"{name}={value}" for name, value in self._variables().items())}
        (self.folder / "known_hosts").write_text(f"[127.0.0.1]:{port} {key}")
        (self.folder / "sshd_config").write_text(SERVER.format(**known))
        (self.folder / "config").write_text(CLIENT.format(**known))
        users = {user.pw_name: ":".join(map(str, user)) for user in pwd.getpwall()}
        users.setdefault("sshd", "sshd:x:65533:65534::/run/sshd:/usr/sbin/nologin")
        (self.folder / "passwd").write_text("".join(f"{line}\n" for line in users.values()))
        (self.folder / "shadow").write_text("".join(f"{name}:*:::::::\n" for name in users))
