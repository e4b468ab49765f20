-- Wireshark dissector: every field of every message, as protocol/PROTOCOL.md lays them out, and of sealed
-- datagrams what can be read without the key.
-- wireshark -X lua_script:scripts/wireshark/haptic.lua, or copy it to the personal plugins folder.

local PORT = 47800
local VERSION = 2
local MAGIC = "HLMI"
local LARGEST_DATAGRAM = 1200
local MOST_PARTS = 64
local HELLO, REJECT = 1, 3

local haptic = Proto("hlm", "Haptic local model")
local malformed = ProtoExpert.new("hlm.malformed", "Not as the protocol demands",
                                  expert.group.MALFORMED, expert.severity.ERROR)
local other_version = ProtoExpert.new("hlm.other_version", "Another version of the protocol",
                                      expert.group.UNDECODED, expert.severity.WARN)
local unknown_type = ProtoExpert.new("hlm.unknown_type", "A type of message of a newer version",
                                     expert.group.UNDECODED, expert.severity.WARN)

-- Kinds of fields. `make` declares a Wireshark field; `read` gives a value from a TvbRange.

local function integer(declare, size, read, display)
  local function make(abbr, node)
    return declare(abbr, node.label, display or base.DEC, node.values, nil, node.meaning)
  end
  return {size = size, make = make, read = read}
end
local function described(declare)
  return function(abbr, node) return declare(abbr, node.label, node.meaning) end
end
local function read_unsigned(range) return range:le_uint() end
local function read_signed(range) return range:le_int() end
local function read_unsigned64(range) return range:le_uint64() end
local function read_signed64(range) return range:le_int64() end
local function read_float(range) return range:le_float() end
local function read_raw(range) return range:raw() end

local U8 = integer(ProtoField.uint8, 1, read_unsigned)
local I8 = integer(ProtoField.int8, 1, read_signed)
local U16 = integer(ProtoField.uint16, 2, read_unsigned)
local U32 = integer(ProtoField.uint32, 4, read_unsigned)
local U64 = integer(ProtoField.uint64, 8, read_unsigned64)
local I64 = integer(ProtoField.int64, 8, read_signed64)
local HEX32 = integer(ProtoField.uint32, 4, read_unsigned, base.HEX)
local HEX64 = integer(ProtoField.uint64, 8, read_unsigned64, base.HEX)
local F32 = {size = 4, make = described(ProtoField.float), read = read_float, is_number = true}
local F64 = {size = 8, make = described(ProtoField.double), read = read_float, is_number = true}
local TEXT = {encoding = ENC_UTF_8, make = described(ProtoField.string), read = read_raw}
local function make_bytes(abbr, node)
  return ProtoField.bytes(abbr, node.label, base.NONE, node.meaning)
end
local BYTES = {encoding = ENC_NA, make = make_bytes, read = read_raw}

-- What a receiver demands of a value: `holds` for all that are allowed, `text` of the others. Of a
-- group `holds` sees the values of its fields by name.

local FINITE = {holds = function(value) return value - value == 0 end, text = "is not finite"}
local NOT_NEGATIVE = {holds = function(value) return value >= 0 end, text = "is negative"}
local POSITIVE = {holds = function(value) return value > 0 end, text = "is not positive"}
local NOT_0 = {holds = function(value) return value ~= UInt64(0) end, text = "is 0"}
local PRINTABLE = {holds = function(value) return not value:find("[%z\1-\31\127]") end,
                   text = "has a control character"}

local function between(least, most)
  return {holds = function(value) return value >= least and value <= most end,
          text = string.format("is not within %g to %g", least, most)}
end

local function unit_length(components)
  local function holds(values)
    local sum = 0
    for _, component in ipairs(components) do sum = sum + values[component] ^ 2 end
    return math.abs(math.sqrt(sum) - 1) <= 1e-3
  end
  return {holds = holds, text = "is not of length 1 within 1e-3"}
end

local LENGTH = between(-1e4, 1e4)
local SPEED = between(-1e3, 1e3)

-- What a number of several components consists of.
local XYZ = {"x", "y", "z"}
local POSE = {"p.x", "p.y", "p.z", "R.w", "R.x", "R.y", "R.z"}
local TWIST = {"linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"}
local WRENCH = {"force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z"}
local INERTIA = {"xx", "yy", "zz", "xy", "xz", "yz"}
local UNIT = unit_length(XYZ)
local UNIT_QUATERNION = unit_length({"R.w", "R.x", "R.y", "R.z"})

-- Of a bitmap, the first in the lowest bits.
local WORDS = {"0", "1", "2", "3"}

-- The upper triangle of a symmetric matrix, row by row.
local TRIANGLE = {}
for row = 1, 6 do
  for column = row, 6 do table.insert(TRIANGLE, row .. column) end
end

-- Of a curve: of each power of x seven factors.
local CURVE = {}
for power = 0, 9 do
  for _, component in ipairs(POSE) do table.insert(CURVE, component .. " x^" .. power) end
end

-- A label is the field's name, and its unit behind it in brackets.

local function field(kind, label, meaning, demand)
  return {kind = kind, name = label:match("^%S+"), label = label, meaning = meaning, demand = demand}
end

-- A field or a list that older senders of this version do not know.
local function optional(node)
  node.is_optional = true
  return node
end

local function code(label, meaning, values)
  local node = field(U8, label, meaning)
  node.values = values
  return node
end

local function flag(label, meaning)
  local node = code(label, meaning, {[0] = "no", "yes"})
  node.demand = between(0, 1)
  return node
end

-- `count` names an earlier field that says how often this one is repeated, `length` one that says how
-- many bytes it has.
local function coordinates(kind, label, count, meaning, demand)
  local node = field(kind, label, meaning, demand)
  node.count = count
  return node
end

local function text(label, length, meaning)
  local node = field(TEXT, label, meaning, type(length) == "string" and PRINTABLE)
  if type(length) == "string" then node.length = length else node.size = length end
  return node
end

local function data(label, length, meaning)
  local node = field(BYTES, label, meaning)
  node.length = length
  return node
end

local function bytes(name, label, size) return {kind = BYTES, name = name, label = label, size = size} end

local function group(label, meaning, children, demand)
  return {name = label:match("^%S+"), label = label, meaning = meaning, children = children,
          demand = demand}
end

-- Of a pose `demand` holds for the position. `whole` is demanded of all components together.
local function numbers(kind, label, components, meaning, demand, whole)
  local children = {}
  for _, component in ipairs(components) do
    local holds = demand and not component:find("^R") and demand
    table.insert(children, field(kind, component, nil, holds))
  end
  return group(label, meaning, children, whole)
end

local function list(name, item, most) return {name = name, item = item, most = most} end

-- Fields: from protocol/PROTOCOL.md, by tests/protocol/dissector_fields.py --write.
local TYPES = {"hello", "welcome", "reject", "contact_update", "proxy_state", "goodbye", "control", "ticks", "local_state", "refusal", "impulses", "scene_chunk", "scene_state", "held_bodies"}
local TABLES = {
  header = {
    text("magic", 4, "the bytes HLMI (48 4C 4D 49)"),
    field(U16, "version", "of the protocol"),
    code("type", "of the message, section 3", TYPES),
    field(U8, "flags", "none in this version"),
    field(HEX64, "session", "id that the server gave in its welcome"),
    field(U64, "sequence", "number of the message, section 5"),
    field(I64, "send_time [ns]", "ns, the sender's own steady clock, any origin"),
    field(U8, "part", "which part this is"),
    field(U8, "parts", "number of parts of the message"),
    field(U8, "tool", "index of the tool"),
    field(U8, "reserved", "none in this version"),
    field(U16, "length", "bytes of this datagram, header included"),
    field(U16, "block", "bytes of the fixed fields after the header"),
  },
  list = {
    field(U16, "first", "index in the whole list of this part's first item"),
    field(U16, "count", "items in this part"),
    field(U16, "total", "items in all parts"),
    field(U16, "item_size", "bytes of each item"),
  },
  hello = {
    field(HEX64, "nonce", "drawn for each session asked for, from a source that nobody can guess"),
    field(F64, "ve_rate [Hz]", "nominal step rate of the VE, Hz"),
    field(F64, "epsilon [m]", "contacts up to this separation ε are reported, at least, m"),
    numbers(F64, "gravity [m/s²]", XYZ, "acceleration of gravity, world, m/s²"),
    field(F64, "tool_length [m]", "characteristic length of the tool, m"),
    numbers(F64, "X_LH", POSE, "pose of the hand's frame in the hand link's frame"),
    field(U8, "hand_link", "the link that the user holds"),
    field(U8, "q_size", "length of q", between(1, 17)),
    coordinates(F64, "q", "q_size", "initial configuration"),
    optional(flag("clears_fault", "a person asks for this session, and it ends a fault of the server (section 5)")),
    list("links", "link", 16),
    optional(list("curves", "curve", 16)),
  },
  link = {
    field(I8, "parent", "index of the parent link"),
    code("joint", "by code, section 1", {[0] = "fixed", [1] = "revolute", [2] = "prismatic", [3] = "planar", [4] = "free", [5] = "guided", [6] = "following"}),
    numbers(F64, "X_PJ", POSE, "pose of the joint's frame in the parent's frame"),
    numbers(F64, "axis", XYZ, "of a revolute or prismatic joint, in J"),
    field(F64, "mass [kg]", "of the link, kg"),
    numbers(F64, "com [m]", XYZ, "centre of mass in the link's frame, m"),
    numbers(F64, "inertia [kg·m²]", INERTIA, "about the centre of mass, link's axes, kg·m²"),
    field(F64, "lower [rad or m]", "least q of a revolute, prismatic or guided joint, rad or m"),
    field(F64, "upper", "its largest q"),
  },
  curve = {
    field(U8, "link", "index of the link"),
    field(U8, "leader", "index of the guided link whose coordinate it is"),
    field(F64, "armature", "what a motor adds to the coordinate's inertia, kg or kg·m²"),
    numbers(F32, "terms [m]", CURVE, "factors of 1, x, x², … x⁹, seven each"),
  },
  welcome = {
    field(HEX64, "nonce", "of the hello that is answered"),
    field(F64, "servo_rate [Hz]", "rate of the local model, Hz", POSITIVE),
    field(HEX64, "fingerprint", "of the server's effective options"),
    code("update_rule", nil, {[0] = "retain", [1] = "paper", [2] = "intermediate_representation", [3] = "plane_recovery"}),
    code("controller", nil, {[0] = "four_channel", [1] = "three_channel", [2] = "virtual_coupler", [3] = "direct", [4] = "rotation_coupler", [5] = "engine_coupler", [6] = "engine_force"}),
    field(F64, "stiffness [N/m]", "of each contact, N/m"),
    field(F64, "damping [N·s/m]", "of each contact, N·s/m"),
    field(F64, "friction", "coefficient"),
    field(F64, "restitution", "coefficient"),
    field(F64, "coupling_stiffness [N/m]", "between device and proxy, N/m"),
    field(F64, "coupling_damping [N·s/m]", "N·s/m"),
    field(F64, "coupling_angular_stiffness [N·m/rad]", "N·m/rad"),
    field(F64, "coupling_angular_damping [N·m·s/rad]", "N·m·s/rad"),
    field(F64, "silence_time [s]", "when nothing of the session has come for this long, force fades, s (section 5)", POSITIVE),
    field(F64, "fade_time [s]", "from full force to none, s", POSITIVE),
    field(F64, "least_update_rate [Hz]", "below this rate of updates force comes and goes, Hz", POSITIVE),
    flag("movable_bodies", "the server uses bodies and contacts between them"),
    flag("axes", "0"),
    flag("self_contacts", "contacts between two links of the tool act"),
    field(F64, "max_force [N]", "rating of the device, N", NOT_NEGATIVE),
    field(F64, "max_torque [N·m]", "N·m", NOT_NEGATIVE),
    field(F64, "max_stiffness [N/m]", "N/m", NOT_NEGATIVE),
    field(F64, "max_angular_stiffness [N·m/rad]", "N·m/rad", NOT_NEGATIVE),
    field(F64, "scale", "metres in the world for each metre of the handle", POSITIVE),
    field(U8, "buttons", "how many the device has"),
    flag("gripper", "it measures a gripper's opening"),
    flag("renders_torque", "it renders torque"),
    flag("measures_hand", "the hand's wrench is known"),
    flag("guidable", "a control can hold the hand of the device"),
    field(U8, "text_size", "bytes of name", between(0, 200)),
    text("name", "text_size", "of the device, UTF-8"),
    optional(field(U8, "freedoms", "directions in which the device's handle moves in the world, bit 0 for x, 1 y, 2 z, 3 to 5 rotation about them")),
    optional(flag("observes_hand", "the hand's wrench is not measured but estimated, from the handle's motion")),
    optional(flag("scenes", "the server takes shapes and placements (section B)")),
    optional(flag("holds", "it takes inertias, too, and moves the bodies that the hand holds (section B)")),
    optional(flag("guides", "tools may have guided joints, and updates drives")),
  },
  reject = {
    field(HEX64, "nonce", "of the hello that is answered"),
    code("reason", nil, {[1] = "version", [2] = "busy", [3] = "tool", [4] = "fault"}),
    field(U8, "text_size", "bytes of text", between(0, 200)),
    field(U16, "version_spoken", "version that the server speaks"),
    text("text", "text_size", "UTF-8, for a person"),
  },
  contact_update = {
    field(F64, "ve_time [s]", "simulated time of the VE, s"),
    field(F64, "ve_period [s]", "simulated length of the latest step, s", between(0, 1e6)),
    field(F64, "compute_time [s]", "from sampling q to sending this, client's clock, s", between(0, 1e6)),
    field(U64, "echo_step", "step of the newest proxy state received in this session"),
    field(F64, "echo_hold [s]", "from the arrival of that proxy state to sending this, client's clock, s (section 6)", between(0, 1e6)),
    field(F64, "impulse_step", "step up to which the bodies' state contains the impulses", NOT_NEGATIVE),
    field(U8, "q_size", "length of q", between(1, 17)),
    field(U8, "v_size", "length of v", between(1, 16)),
    coordinates(F64, "q", "q_size", "tool configuration for which the contacts were computed", LENGTH),
    coordinates(F64, "v", "v_size", "its generalised velocity q̇", SPEED),
    optional(field(U32, "scene")),
    list("bodies", "body", 16),
    list("contacts", "contact", 192),
    optional(list("poses", "pose", 64)),
    optional(list("rates", "rate", 16)),
    optional(list("external", "wrench", 16)),
    optional(list("owners", "owner", 64)),
    optional(list("drives", "drive", 16)),
  },
  body = {
    field(U32, "id", "the VE's number for it, the same in every update"),
    numbers(F64, "p [m]", XYZ, "centre of mass, world, m", LENGTH),
    numbers(F64, "V", TWIST, "twist", SPEED),
    numbers(F64, "A [m/s²]", TWIST, "acceleration by all forces except contacts (gravity, motors, springs), m/s², rad/s²", between(-1e6, 1e6)),
    numbers(F64, "W", TRIANGLE, "inverse inertia that its joints leave it, 1/kg and 1/(kg·m²), rows and columns as in a twist, without negative eigenvalues", between(-1e12, 1e12)),
    numbers(F64, "P [N·s]", TWIST, "total impulse of the tool that this state contains, of those reported in impulses, N·s, and about the centre of mass N·m·s", between(-1e6, 1e6)),
    code("round", "what turning leaves its shape as it is, so that its contacts do not go round with it", {[0] = "none", [1] = "axis", [2] = "sphere"}),
    numbers(F32, "axis", XYZ, "unit axis of that, with round 1", between(-2, 2)),
  },
  contact = {
    field(HEX64, "identity", "the same from update to update while the contact lasts, different for any two contacts of one update"),
    field(U32, "pair", "which pair of convex pieces it belongs to"),
    field(U16, "axis"),
    code("a_kind", "of side a", {[0] = "world", [1] = "tool_link", [2] = "movable_body"}),
    code("b_kind", "of side b", {[0] = "world", [1] = "tool_link", [2] = "movable_body"}),
    field(U32, "a", "index of the link, or id of the body"),
    field(U32, "b", "index of the link, id of the body, or the VE's number for what it is"),
    numbers(F64, "p [m]", XYZ, "point on the surface of b, world, m", LENGTH),
    numbers(F64, "n", XYZ, "normal from b to a, world", nil, UNIT),
    field(F64, "separation [m]", "true separation σ, m", LENGTH),
    numbers(F32, "v_point [m/s]", XYZ, "velocity of b's point p, world, m/s", SPEED),
    field(F32, "friction", "coefficient of the two materials", between(-10, 10)),
    field(F32, "load [N]", "present normal force, N, of a contact without the tool", between(0, 1e6)),
    code("plane", nil, {[0] = "b", [1] = "a"}),
  },
  rate = {
    field(U32, "body", "id of the body"),
    numbers(F64, "A_rate", TWIST, "how fast its A changes, m/s³, rad/s³", between(-1e8, 1e8)),
  },
  wrench = {
    field(U8, "link", "index of the link"),
    numbers(F64, "F [N]", WRENCH, "force, N, and torque, N·m, about the origin of the link's frame, world axes", between(-1e6, 1e6)),
  },
  pose = {
    field(U32, "body", "the VE's number for it, as in the side of a placement"),
    numbers(F64, "X_WB", POSE, "pose of the body's frame in the world", LENGTH, UNIT_QUATERNION),
    numbers(F64, "V", TWIST, "twist at that frame's origin", SPEED),
  },
  owner = {
    field(U32, "body", "the VE's number for it, as in its pose"),
    field(U32, "number", "of the latest held body that the client knows of it, or higher"),
    flag("kept", "the server must not move it: another hand holds it"),
    field(U8, "slowed", "how much slower the body's time goes than the hand's, in 1/255"),
  },
  drive = {
    field(U8, "link", "index of the link whose joint it is"),
    flag("follows_device", "where the device has a gripper, that leads: its opening, 0 to 1, goes from closed to open"),
    field(F64, "target", "coordinate that it goes to", LENGTH),
    field(F64, "closed", "coordinate of the closed gripper", LENGTH),
    field(F64, "open", "coordinate of the open gripper", LENGTH),
    field(F64, "stiffness", "of the spring", between(0, 1e9)),
    field(F64, "damping", "of the damper", between(0, 1e9)),
    field(F64, "most", "largest force", between(0, 1e9)),
  },
  proxy_state = {
    field(U64, "acknowledged", "sequence of the update that was taken"),
    field(U64, "step", "periods of the loop since the session began, this one and missed ones included"),
    field(F64, "age [s]", "age that the server attributed to the update's contacts, s", NOT_NEGATIVE),
    field(F64, "update_send_time", "send_time of that update, client's clock, converted to s"),
    field(F64, "hold [s]", "from the arrival of the update to sending this, server's clock, s", NOT_NEGATIVE),
    code("server", nil, {[0] = "off", [1] = "active", [2] = "fading", [3] = "fault", [4] = "arming", [5] = "ramping"}),
    code("fault", nil, {[0] = "none", [1] = "non_finite", [2] = "overrun", [3] = "device", [4] = "implausible", [5] = "operator_stop", [6] = "handle_speed", [7] = "workspace", [8] = "energy"}),
    code("contact_state", "of the proxy", {[0] = "free_motion", [1] = "colliding", [2] = "resting"}),
    code("limit", "what keeps F_command from being the wanted wrench", {[0] = "none", [1] = "force", [2] = "torque", [3] = "rate", [4] = "fade", [5] = "power", [6] = "energy"}),
    field(U16, "active_contacts", "local contacts with separation ≤ 0"),
    field(U16, "predicted_contacts", "local contacts with separation > 0"),
    field(F64, "smallest_separation [m]", "over all local contacts, m"),
    numbers(F64, "X_WD", POSE, "pose of the device's handle in the world", nil, UNIT_QUATERNION),
    numbers(F64, "V_WD", TWIST, "twist of the device's handle"),
    numbers(F64, "F_env", WRENCH, "contact wrench on the hand"),
    numbers(F64, "F_command", WRENCH, "wrench commanded to the device, after all limits"),
    numbers(F64, "F_hand", WRENCH, "the hand's wrench, as far as known"),
    flag("hand_measured", "F_hand is known"),
    field(U32, "buttons", "those of the device that are down, bit i for button i"),
    field(F64, "gripper", "opening of its gripper, 0 closed to 1 open"),
    field(F64, "scale", "metres in the world for each metre of the handle", POSITIVE),
    field(U64, "overruns", "periods missed since the server started"),
    field(U64, "updates", "updates taken in this session"),
    field(U64, "dropped", "datagrams dropped since the server started, all reasons"),
    field(U64, "control", "sequence of the control in effect"),
    field(U8, "q_size", "length of q", between(1, 17)),
    field(U8, "v_size", "length of v", between(1, 16)),
    coordinates(F64, "q", "q_size", "configuration of the proxy"),
    coordinates(F64, "v", "v_size", "generalised velocity q̇ of the proxy"),
    optional(code("fade", "why force fades, or waits at zero", {[0] = "none", [1] = "client_silent", [2] = "contacts_old", [3] = "updates_invalid", [4] = "client_left"})),
    optional(field(F64, "given [J]", "energy that the device has given to the hand since the session began, J")),
    optional(field(F64, "taken [J]", "energy that it has taken from the hand, J")),
    optional(field(F64, "explained [J]", "of given − taken the work of the tool's weight and of moving constraints, J")),
    optional(field(F64, "tank [J]", "energy that it may still give beyond that, J")),
    optional(field(F64, "brought [J]", "energy that updates have brought into the contacts' springs, J")),
    optional(flag("hand_observed", "F_hand is not measured but estimated, from the handle's motion")),
    optional(field(F64, "lowered", "share, 0 to 1, of the stiffness and damping that the control asks for that is not in effect, because the device is late and does not bear it")),
    optional(field(U32, "scene", "number of the scene in force (section B), 0 none")),
    optional(field(U32, "spare")),
    optional(field(U8, "spare_byte")),
    optional(field(F64, "grip", "force of contacts that opens the driven joints, N or N·m of their coordinates, their sum")),
  },
  goodbye = {
    code("reason", nil, {[0] = "finished", [1] = "shutdown"}),
  },
  control = {
    flag("telemetry", "send ticks and local states"),
    flag("holds", "the person holds the hand of a simulated device"),
    numbers(F64, "X_target", POSE, "where it is held", LENGTH, UNIT_QUATERNION),
    flag("tuned", "the following fields are in effect"),
    code("update_rule", "as in the welcome", {[0] = "retain", [1] = "paper", [2] = "intermediate_representation", [3] = "plane_recovery"}),
    code("controller", "as in the welcome", {[0] = "four_channel", [1] = "three_channel", [2] = "virtual_coupler", [3] = "direct", [4] = "rotation_coupler", [5] = "engine_coupler", [6] = "engine_force"}),
    field(F64, "stiffness [N/m]", "of each contact, N/m", between(1, 1e6)),
    field(F64, "damping [N·s/m]", "of each contact, N·s/m", between(0, 1e4)),
    field(F64, "friction", "coefficient, static and kinetic", between(0, 10)),
    field(F64, "restitution", "coefficient", between(0, 1)),
    field(F64, "coupling_stiffness [N/m]", "between device and proxy, N/m", between(0, 1e5)),
    field(F64, "coupling_damping [N·s/m]", "N·s/m", between(0, 1e3)),
    field(F64, "coupling_angular_stiffness [N·m/rad]", "N·m/rad", between(0, 1e3)),
    field(F64, "coupling_angular_damping [N·m·s/rad]", "N·m·s/rad", between(0, 10)),
  },
  ticks = {
    field(U64, "first_step", "step of the first item", NOT_0),
    list("ticks", "tick", 8),
  },
  tick = {
    numbers(F64, "F_env [N]", XYZ, "contact force on the hand, N"),
    numbers(F64, "F_command [N]", XYZ, "force commanded to the device, after all limits, N"),
    numbers(F64, "F_hand [N]", XYZ, "the hand's force, as far as known, N"),
    field(F64, "torque [N·m]", "magnitude of the commanded torque, N·m"),
    field(F64, "smallest_separation [m]", "over all local contacts, m"),
    field(F64, "device_proxy [m]", "distance of handle and proxy, m"),
    field(F64, "proxy_tool [m]", "distance of the proxy and the VE's tool of the latest update, m"),
    field(F64, "lateness [s]", "of the step's beginning, s"),
    field(F64, "execution [s]", "time that the step before took, s"),
    field(F64, "age [s]", "of the newest contacts when they were taken, s"),
    field(U16, "active_contacts", "local contacts with separation ≤ 0"),
    field(U16, "predicted_contacts", "local contacts with separation > 0"),
    flag("adopted", "an update was taken in this step"),
    code("limit", "what keeps F_command from being the wanted wrench", {[0] = "none", [1] = "force", [2] = "torque", [3] = "rate", [4] = "fade", [5] = "power", [6] = "energy"}),
  },
  local_state = {
    field(U64, "step", "of the local model"),
    list("contacts", "local_contact", 64),
  },
  local_contact = {
    field(HEX64, "identity", "of the reported contact"),
    code("a_kind", "as in a contact", {[0] = "world", [1] = "tool_link", [2] = "movable_body"}),
    code("b_kind", "as in a contact", {[0] = "world", [1] = "tool_link", [2] = "movable_body"}),
    field(U32, "a", "as in a contact"),
    field(U32, "b", "as in a contact"),
    code("state", nil, {[0] = "impending", [1] = "colliding", [2] = "penetrating", [3] = "separating"}),
    flag("retained", "while its load is being released"),
    numbers(F64, "c [m]", XYZ, "point of the constraint, world, m"),
    numbers(F64, "n", XYZ, "normal from b to a, world", nil, UNIT),
    numbers(F64, "p [m]", XYZ, "the local contact point, world, m"),
    field(F64, "s [m]", "separation, m"),
    numbers(F64, "f [N]", XYZ, "force on a, world, N"),
  },
  refusal = {
    field(U64, "refused", "sequence of the update"),
    code("error", nil, {[0] = "none", [1] = "layout", [2] = "non_finite", [3] = "tool", [4] = "quaternion", [5] = "range", [6] = "normal", [7] = "side", [8] = "duplicate", [9] = "drive"}),
    flag("whole", "the update was not used"),
    field(U16, "item", "index of the first contact (of a body or a pose, where only those are wrong) with the error"),
    field(U64, "count", "updates refused as a whole in this session"),
  },
  impulses = {
    field(U64, "step", "period of the loop as in the proxy state"),
    list("bodies", "impulse", 16),
  },
  impulse = {
    field(U32, "body", "id of the body"),
    numbers(F64, "P [N·s]", TWIST, "impulse on it since the session began, N·s, and about its centre of mass N·m·s, world axes"),
  },
  held_bodies = {
    field(U64, "step", "period of the loop as in the proxy state"),
    list("bodies", "held_body", 8),
  },
  held_body = {
    field(U32, "body", "the VE's number for it"),
    field(U32, "number", "odd"),
    numbers(F64, "X_WB", POSE, "pose of the body's frame in the world", nil, UNIT_QUATERNION),
    numbers(F64, "V", TWIST, "twist at that frame's origin"),
  },
  scene_chunk = {
    field(U64, "number", "which chunk"),
    field(U16, "data_size", "bytes of data", between(1, 1024)),
    data("data", "data_size", "the stream's bytes, behind those of the chunk before"),
  },
  scene_state = {
    field(U64, "next", "all chunks below this number have been taken"),
    numbers(HEX64, "bitmap", WORDS, "bit i of word w"),
    field(U32, "scene", "number of the scene in force, 0 none"),
    field(U32, "received_scene", "number of the latest commit that was read, 0 none"),
    field(U32, "shapes", "that the server holds"),
    field(U32, "placements", "that it holds"),
    field(U64, "bytes", "that its shapes take"),
    code("error", "why the stream is refused", {[0] = "none", [1] = "malformed", [2] = "hash", [3] = "unknown_shape", [4] = "duplicate", [5] = "unknown_placement", [6] = "limit", [7] = "geometry", [8] = "side", [9] = "order", [10] = "slow"}),
    field(U32, "item", "id of the placement that the error is about, else 0"),
    field(U8, "text_size", "bytes of text", between(0, 200)),
    text("text", "text_size", "UTF-8, for a person"),
  },
}
-- End of fields.

-- Messages: the block of fixed fields, then the lists, each behind a header of its own.

local function append(to, more)
  for _, item in ipairs(more) do table.insert(to, item) end
  return to
end

-- Each list declares fields of its own.
local function copies(nodes)
  local made = {}
  for i, node in ipairs(nodes) do made[i] = field(node.kind, node.label, node.meaning) end
  return made
end

local function message(name)
  local fields, lists = {}, {}
  for _, row in ipairs(TABLES[name]) do table.insert(row.item and lists or fields, row) end
  for _, one in ipairs(lists) do
    one.header = group(one.name, nil, copies(TABLES.list))
    one.item = group(one.item, nil, TABLES[one.item])
  end
  return {name = name, block = group(name, nil, fields), lists = lists}
end

local messages = {}
for number, name in ipairs(TYPES) do messages[number] = message(name) end

local HEADER_SIZE = 40
local header = group("header", nil, TABLES.header)
-- These three, the nonce of a hello and the whole of a reject are the same in every version.
local stable_fields = {table.unpack(TABLES.header, 1, 3)}
local other_header = group("other_header", "of another version", append(stable_fields, {
  bytes("other", "Other fields", HEADER_SIZE - 7),
}))

-- Sealed datagrams: their packets, by type.
local SEALING_MAGIC = "HLS"
local KEY_SIZE, INDEX_SIZE, TAG_SIZE = 32, 4, 16

local function handshake_message()
  return {bytes("public_key", "Ephemeral public key", KEY_SIZE),
          bytes("payload", "Index of the sender, sealed", INDEX_SIZE + TAG_SIZE)}
end
local receiver = function() return field(HEX32, "receiver", "index of the receiver") end

local packets = {
  group("initiation", "First message of a handshake", handshake_message()),
  group("response", "Second message of a handshake", append({receiver()}, handshake_message())),
  group("sealed", "Sealed datagram", {receiver(), field(U64, "counter")}),
}
local SEALED = 3
local packet_header = group("packet", "Sealing", {
  text("magic", #SEALING_MAGIC),
  code("type", "of the packet", {"initiation", "response", "sealed"}),
})
local sealed_text = bytes("text", "Text, sealed, and its tag")

local newer_fields = {kind = BYTES, name = "newer_fields", label = "Fields of a newer version"}
local newer_lists = {kind = BYTES, name = "newer_lists", label = "Lists of a newer version"}
local newer_message = {kind = BYTES, name = "newer_message", label = "Message of a newer version"}

-- Wireshark's fields are named hlm.<table>.<field>, with the names of PROTOCOL.md, those of the header
-- hlm.<field>; a component adds its own name: hlm.contact.n.z. A list's own numbers are
-- hlm.<message>.<list>.total and so on.

local declared = {}

local function declare(node, prefix, abbr)
  if node.field then return end
  abbr = abbr or (prefix .. "." .. node.name)
  if node.children then
    node.field = ProtoField.none(prefix .. "." .. node.name, node.label, node.meaning)
    for _, child in ipairs(node.children) do declare(child, abbr) end
  else
    node.field = node.kind.make(abbr, node)
  end
  table.insert(declared, node.field)
end

declare(header, "hlm", "hlm")
declare(other_header, "hlm", "hlm")
declare(packet_header, "hlm")
for _, packet in ipairs(packets) do declare(packet, "hlm") end
declare(sealed_text, "hlm.sealed")
for _, node in ipairs({newer_fields, newer_lists, newer_message}) do declare(node, "hlm") end
for _, known in pairs(messages) do
  declare(known.block, "hlm")
  for _, part in ipairs(known.lists) do
    declare(part.header, "hlm." .. known.name)
    declare(part.item, "hlm")
  end
end
haptic.fields = declared
haptic.experts = {malformed, other_version, unknown_type}

-- Dissection. A cursor walks over the datagram and remembers the values of its fields by name. What
-- it reads lies before `stop`; once `ended`, nothing more is dissected.

local function complain(tree, text) tree:add_proto_expert_info(malformed, text) end

-- The next `size` bytes; nil where the datagram, or the part of it that is dissected, ends before.
local function take(cursor, size, tree, name)
  if cursor.ended then return nil end
  if cursor.offset + size > cursor.stop then
    cursor.ended = true
    local captured = cursor.tvb:len()
    if cursor.stop < captured or captured == cursor.tvb:reported_len() then
      complain(tree, "No room for " .. name)
    end
    return nil
  end
  local range = cursor.tvb(cursor.offset, size)
  cursor.offset = cursor.offset + size
  return range
end

local function check(demand, value, name, tree)
  local holds = demand.holds(value)
  if not holds then complain(tree, name .. " " .. demand.text) end
  return holds
end

local function dissect_leaf(node, cursor, tree)
  if node.is_optional and cursor.offset >= cursor.stop then return end
  local size = node.kind.size or node.size or cursor.values[node.length]
  if size == 0 then return end
  local range = take(cursor, size, tree, node.name)
  if not range then return end
  local value = node.kind.read(range)
  cursor.values[node.name] = value
  local item = tree:add_packet_field(node.field, range, node.kind.encoding or ENC_LITTLE_ENDIAN)
  if node.values and not node.values[value] then
    item:set_text(string.format("%s: unknown (%d)", node.label, value))
  end
  if node.kind.is_number and not check(FINITE, value, node.name, item) then return end
  if node.demand then check(node.demand, value, node.name, item) end
end

-- Returns the tree of a group.
local function dissect(node, cursor, tree)
  if cursor.ended then return tree end
  if not node.children then
    local count = node.count and cursor.values[node.count] or 1
    for _ = 1, count do dissect_leaf(node, cursor, tree) end
    return tree
  end
  local start = cursor.offset
  if start >= cursor.stop then
    take(cursor, 1, tree, node.name)
    return tree
  end
  local subtree = tree:add(node.field, cursor.tvb(start))
  for _, child in ipairs(node.children) do dissect(child, cursor, subtree) end
  subtree:set_len(cursor.offset - start)
  if node.demand and not cursor.ended then check(node.demand, cursor.values, node.name, subtree) end
  return subtree
end

-- All up to `stop`, of which this version knows nothing.
local function dissect_rest(node, cursor, tree)
  if cursor.ended or cursor.offset >= cursor.stop then return end
  tree:add(node.field, take(cursor, cursor.stop - cursor.offset, tree, node.name))
end

-- A group in `size` bytes, which may hold more than is known.
local function dissect_extensible(node, size, cursor, tree)
  local start, stop = cursor.offset, cursor.stop
  cursor.stop = math.min(start + size, stop)
  local subtree = dissect(node, cursor, tree)
  if cursor.offset > start then
    dissect_rest(newer_fields, cursor, subtree)
    subtree:set_len(cursor.offset - start)
  end
  cursor.stop = stop
  if start + size > stop then take(cursor, start + size - cursor.offset, subtree, node.name) end
end

-- Why the header cannot be one of this message; nil if it can.
local function find_header_error(head, message, length)
  if head.length ~= length then
    return string.format("The length field says %d bytes, the datagram has %d", head.length,
                         length)
  end
  if length > LARGEST_DATAGRAM then return "Longer than " .. LARGEST_DATAGRAM .. " bytes" end
  if head.flags ~= 0 or head.tool ~= 0 then return "Flags or tool are not 0" end
  if head.part >= head.parts then return "Part beyond the last" end
  if head.parts > MOST_PARTS then return "More than " .. MOST_PARTS .. " parts" end
  if head.parts > 1 and #message.lists == 0 then return "Parts of a message without lists" end
  if head.sequence == UInt64(0) then return "Sequence 0" end
  local outside_sessions = head.type == HELLO or head.type == REJECT
  if (head.session == UInt64(0)) ~= outside_sessions then
    return "Session 0 belongs to hello and reject, and to them alone"
  end
  return nil
end

-- Why a list cannot be one of this part; nil if it can.
local function find_list_error(list, numbers, head)
  local stop = numbers.first + numbers.count
  if numbers.total > list.most then return "More than " .. list.most .. " items" end
  if stop > numbers.total then return "Items beyond the last" end
  if head.part == 0 and numbers.first > 0 then return "The first part lacks the first item" end
  if head.part == head.parts - 1 and stop < numbers.total then
    return "The last part lacks the last item"
  end
  return nil
end

-- Returns how many items the message has in all; nil if the datagram does not say.
local function dissect_list(list, head, cursor, tree)
  if list.is_optional and not cursor.ended and cursor.offset >= cursor.stop then return nil end
  local start = cursor.offset
  local subtree = dissect(list.header, cursor, tree)
  if cursor.ended then return nil end
  local numbers = cursor.values
  cursor.values = {}
  local reason = find_list_error(list, numbers, head)
  if reason then
    complain(subtree, reason)
    cursor.ended = true
  end
  for _ = 1, numbers.count do
    if cursor.ended then break end
    dissect_extensible(list.item, numbers.item_size, cursor, subtree)
  end
  subtree:set_len(cursor.offset - start)
  return numbers.total
end

local function dissect_message(message, head, pinfo, cursor, tree)
  local reason = find_header_error(head, message, cursor.tvb:reported_len())
  if reason then complain(tree, reason) end
  dissect_extensible(message.block, head.block, cursor, tree)
  local block = cursor.values
  if block.acknowledged then
    pinfo.cols.info:append(", acknowledges " .. tostring(block.acknowledged))
  end
  for _, list in ipairs(message.lists) do
    local total = dissect_list(list, head, cursor, tree)
    if total then pinfo.cols.info:append(string.format(", %s %d", list.name, total)) end
  end
  dissect_rest(newer_lists, cursor, tree)
end

-- Whatever the version, a reject can be read.
local function dissect_other_version(head, pinfo, cursor, tree)
  pinfo.cols.info = string.format("%s of version %d", TYPES[head.type] or "message", head.version)
  tree:add_proto_expert_info(other_version)
  if head.type ~= REJECT then return end
  dissect_extensible(messages[REJECT].block, cursor.stop - cursor.offset, cursor, tree)
end

local function describe(head)
  local text = string.format("%s %s", TYPES[head.type] or "unknown type " .. head.type,
                             tostring(head.sequence))
  if head.parts > 1 then
    text = text .. string.format(", part %d of %d", head.part + 1, head.parts)
  end
  return text
end

local function dissect_packet(tvb, pinfo, root)
  pinfo.cols.protocol = "HLM"
  local tree = root:add(haptic, tvb())
  local cursor = {tvb = tvb, offset = 0, stop = tvb:len(), values = {}, ended = false}
  dissect(packet_header, cursor, tree)
  if cursor.ended then return tvb:len() end
  local type = cursor.values.type
  if not packets[type] then
    pinfo.cols.info = "unknown type " .. type
    tree:add_proto_expert_info(unknown_type)
    return tvb:len()
  end
  local subtree = dissect(packets[type], cursor, tree)
  local values = cursor.values
  pinfo.cols.info = packets[type].name
  if values.counter then pinfo.cols.info:append(" " .. tostring(values.counter)) end
  if values.receiver then pinfo.cols.info:append(string.format(" to %08x", values.receiver)) end
  if type ~= SEALED then
    if cursor.offset < cursor.stop then complain(tree, "Longer than its type") end
  elseif cursor.stop - cursor.offset < TAG_SIZE then
    complain(tree, "No room for the tag")
  else
    pinfo.cols.info:append(string.format(", %d bytes", cursor.stop - cursor.offset - TAG_SIZE))
    dissect_rest(sealed_text, cursor, subtree)
    subtree:set_len(cursor.offset - #SEALING_MAGIC - 1)
  end
  return tvb:len()
end

local function begins_with(tvb, magic)
  return tvb:len() >= #magic and tvb(0, #magic):string() == magic
end

-- Returns the number of bytes dissected; 0 if the datagram is not of this protocol.
local function dissect_datagram(tvb, pinfo, root)
  if begins_with(tvb, SEALING_MAGIC) then return dissect_packet(tvb, pinfo, root) end
  if not begins_with(tvb, MAGIC) then return 0 end
  pinfo.cols.protocol = "HLM"
  local tree = root:add(haptic, tvb())
  local cursor = {tvb = tvb, offset = 0, stop = tvb:len(), values = {}, ended = false}
  local is_other = tvb:len() >= 6 and tvb(4, 2):le_uint() ~= VERSION
  dissect(is_other and other_header or header, cursor, tree)
  if cursor.ended then return tvb:len() end

  local head = cursor.values
  cursor.values = {}
  if is_other then
    dissect_other_version(head, pinfo, cursor, tree)
    return tvb:len()
  end
  pinfo.cols.info = describe(head)
  if messages[head.type] then
    dissect_message(messages[head.type], head, pinfo, cursor, tree)
  else
    tree:add_proto_expert_info(unknown_type)
    dissect_rest(newer_message, cursor, tree)
  end
  return tvb:len()
end

haptic.dissector = dissect_datagram
DissectorTable.get("udp.port"):add(PORT, haptic)

-- On any other port, by the magic.
haptic:register_heuristic("udp", function(tvb, pinfo, root)
  return dissect_datagram(tvb, pinfo, root) > 0
end)
