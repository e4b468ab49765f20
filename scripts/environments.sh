# Sourced by scripts that need Python packages which Debian does not have.
# shellcheck shell=bash

# install_environment LOCK: the Python environment .venv/NAME, exactly the packages of LOCK, a file NAME.txt.
install_environment() {
  local lock=$1 environment
  environment=.venv/$(basename "$lock" .txt)
  ! cmp -s "$lock" "$environment/installed.txt" || return 0
  echo "Installing Python packages of $lock"
  rm -rf "$environment"
  /usr/bin/python3 -m venv "$environment"
  # A lock file has all that is needed, and may leave out what a package asks for and does not need.
  "$environment/bin/pip" --quiet --quiet install --disable-pip-version-check --no-compile --only-binary :all: --no-deps \
    --require-hashes -r "$lock"
  cp "$lock" "$environment/installed.txt"
}
