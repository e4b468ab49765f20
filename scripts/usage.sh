# Sourced by the scripts in this folder: how they say what they are, and how they refuse an argument.
# shellcheck shell=bash

# The script that is running, from the project's folder, which is the current one.
script_name=scripts/${0##*/}

# Prints the usage, the comment at the head of the script and what $more_usage holds, and ends the
# script, if --help or -h is among the arguments.
more_usage=
show_usage_if_asked() {
  local argument
  for argument; do
    case "$argument" in
      --help | -h)
        sed -n '2,${/^#/!q;s/^#\{1,\} \{0,1\}//p}' "$script_name"
        [ -z "$more_usage" ] || echo "$more_usage"
        exit 0
        ;;
    esac
  done
}

# refuse ARGUMENT ALLOWED: ends the script with one line that names both.
refuse() {
  echo "$script_name: '$1' must be $2" >&2
  exit 2
}

# refuse_more_than COUNT ALLOWED ARGUMENT …: refuses the first argument beyond COUNT.
refuse_more_than() {
  local count=$1 allowed=$2
  shift 2
  (($# <= count)) || {
    shift "$count"
    echo "$script_name: '$1' is one argument too many: $allowed" >&2
    exit 2
  }
}

# refuse_unless_number ARGUMENT ALLOWED: refuses what is not a whole number of 1 or more.
refuse_unless_number() {
  [[ $1 =~ ^[1-9][0-9]{0,8}$ ]] || refuse "$1" "$2"
}
