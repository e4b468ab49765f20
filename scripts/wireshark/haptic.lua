-- Wireshark dissector: every field of every message, as protocol/PROTOCOL.md lays them out, and of sealed
-- datagrams what can be read without the key.
-- wireshark -X lua_script:scripts/wireshark/haptic.lua, or copy it to the personal plugins folder.

local PORT = 47800
local VERSION = 2
local MAGIC = "HLMI"
local LARGEST_DATAGRAM = 1200
local MOST_PARTS = 64
local LONGEST_TEXT = 200
local MOST_COORDINATES, MOST_VELOCITIES = 17, 16
local HELLO, WELCOME, REJECT, CONTACT_UPDATE, PROXY_STATE, GOODBYE = 1, 2, 3, 4, 5, 6
local CONTROL, TICKS, LOCAL_STATE, REFUSAL, IMPULSES = 7, 8, 9, 10, 11

local haptic = Proto("hlm", "Haptic local model")
local malformed = ProtoExpert.new("hlm.malformed", "Not as the protocol demands",
                                  expert.group.MALFORMED, expert.severity.ERROR)
local other_version = ProtoExpert.new("hlm.other_version", "Another version of the protocol",
                                      expert.group.UNDECODED, expert.severity.WARN)
local unknown_type = ProtoExpert.new("hlm.unknown_type", "A type of message of a newer version",
                                     expert.group.UNDECODED, expert.severity.WARN)

-- Kinds of fields. `make` declares a Wireshark field; `read` gives a value from a TvbRange.

local function make_plain(declare)
  return function(abbr, label) return declare(abbr, label) end
end
local function make_code(abbr, label, values)
  return ProtoField.uint8(abbr, label, base.DEC, values)
end
local function make_hex(abbr, label) return ProtoField.uint64(abbr, label, base.HEX) end
local function read_unsigned(range) return range:le_uint() end
local function read_signed(range) return range:le_int() end
local function read_float(range) return range:le_float() end

local U8 = {size = 1, make = make_plain(ProtoField.uint8), read = read_unsigned}
local I8 = {size = 1, make = make_plain(ProtoField.int8), read = read_signed}
local U16 = {size = 2, make = make_plain(ProtoField.uint16), read = read_unsigned}
local U32 = {size = 4, make = make_plain(ProtoField.uint32), read = read_unsigned}
local U64 = {size = 8, make = make_plain(ProtoField.uint64),
             read = function(range) return range:le_uint64() end}
local I64 = {size = 8, make = make_plain(ProtoField.int64),
             read = function(range) return range:le_int64() end}
local HEX32 = {size = 4, make = function(abbr, label) return ProtoField.uint32(abbr, label, base.HEX) end,
               read = read_unsigned}
local HEX64 = {size = 8, make = make_hex, read = U64.read}
local F32 = {size = 4, make = make_plain(ProtoField.float), read = read_float, is_number = true}
local F64 = {size = 8, make = make_plain(ProtoField.double), read = read_float, is_number = true}
local CODE = {size = 1, make = make_code, read = read_unsigned}
local TEXT = {encoding = ENC_UTF_8, make = make_plain(ProtoField.string),
              read = function(range) return range:raw() end}
local BYTES = {encoding = ENC_NA, make = make_plain(ProtoField.bytes),
               read = function(range) return range:raw() end}

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
local ACCELERATION = between(-1e6, 1e6)
local MOBILITY = between(-1e12, 1e12)
local SPAN = between(0, 1e6)
local IMPULSE = between(-1e6, 1e6)
local XYZ, WXYZ = {"x", "y", "z"}, {"w", "x", "y", "z"}

-- Layouts: lists of fields in the order of their bytes. `count` names an earlier field that says
-- how often this one is repeated; `length` one that says how many bytes it has.

local function field(kind, name, label, unit, demand)
  label = unit and (label .. " [" .. unit .. "]") or label
  return {kind = kind, name = name, label = label, demand = demand}
end

-- A field that older senders of this version do not know.
local function optional(node)
  node.is_optional = true
  return node
end

local function code(name, label, values)
  return {kind = CODE, name = name, label = label, values = values}
end

local function flag(name, label)
  local node = code(name, label, {[0] = "no", "yes"})
  node.demand = between(0, 1)
  return node
end

local function coordinates(name, label, unit, demand)
  local node = field(F64, name, label, unit, demand)
  node.count = "size_" .. name
  return node
end

-- How many coordinates a configuration or velocity has.
local function size(name, most)
  return field(U8, "size_" .. name, "Coordinates of " .. name, nil, between(1, most))
end

local function text_size(name)
  return field(U8, "size_" .. name, "Bytes of the " .. name, nil, between(0, LONGEST_TEXT))
end

local function text(name, label)
  return {kind = TEXT, name = name, label = label, length = "size_" .. name, demand = PRINTABLE}
end

local function group(name, label, children, demand)
  return {name = name, label = label, children = children, demand = demand}
end

local function append(list, more)
  for _, item in ipairs(more) do table.insert(list, item) end
  return list
end

local function numbers(name, label, unit, components, demand, kind)
  local children = {}
  for _, component in ipairs(components) do
    table.insert(children, field(kind or F64, component, component, unit, demand))
  end
  return group(name, label, children)
end

local function vector(name, label, unit, demand, kind)
  return numbers(name, label, unit, XYZ, demand, kind)
end

local function normal(name, label)
  local node = vector(name, label)
  node.demand = unit_length(XYZ)
  return node
end

local function pose(name, label, demand)
  return group(name, label, {
    vector("p", "Position", "m", demand),
    numbers("R", "Rotation, a unit quaternion", nil, WXYZ),
  })
end

local function unit_pose(name, label, demand)
  local node = pose(name, label, demand)
  node.children[2].demand = unit_length(WXYZ)
  return node
end

-- A linear and an angular part.
local function twist(name, label, demand)
  return group(name, label, {
    vector("linear", "Linear velocity", "m/s", demand),
    vector("angular", "Angular velocity", "rad/s", demand),
  })
end

local function acceleration(name, label)
  return group(name, label, {
    vector("linear", "Linear acceleration", "m/s²", ACCELERATION),
    vector("angular", "Angular acceleration", "rad/s²", ACCELERATION),
  })
end

local function wrench(name, label)
  return group(name, label, {vector("force", "Force", "N"), vector("torque", "Torque", "N m")})
end

local function impulse(name, label, allowed)
  return group(name, label, {vector("linear", "Impulse", "N s", allowed),
                             vector("angular", "Angular impulse", "N m s", allowed)})
end

-- The upper triangle of a symmetric matrix, row by row.
local function symmetric(name, label, order, demand)
  local components = {}
  for row = 1, order do
    for column = row, order do table.insert(components, row .. column) end
  end
  return numbers(name, label, nil, components, demand)
end

local SIDES = {[0] = "world", "tool_link", "movable_body"}

local function side_fields()
  return {
    code("a.kind", "Side a, which the normal points to", SIDES),
    code("b.kind", "Side b, which has the point", SIDES),
    field(U32, "a.index", "Link or body of side a"),
    field(U32, "b.index", "Link or body of side b"),
  }
end

local function tuning_fields(is_checked)
  local function number(name, label, unit, least, most)
    return field(F64, name, label, unit, is_checked and between(least, most))
  end
  return {
    code("update_rule", "Update rule",
         {[0] = "retain", "paper", "intermediate_representation", "plane_recovery"}),
    code("controller", "Controller",
         {[0] = "four_channel", "three_channel", "virtual_coupler", "direct", "rotation_coupler",
          "engine_coupler", "engine_force"}),
    number("stiffness", "Stiffness of each contact", "N/m", 1, 1e6),
    number("damping", "Damping of each contact", "N s/m", 0, 1e4),
    number("friction", "Coefficient of friction", nil, 0, 10),
    number("restitution", "Coefficient of restitution", nil, 0, 1),
    number("coupling_stiffness", "Coupling stiffness", "N/m", 0, 1e5),
    number("coupling_damping", "Coupling damping", "N s/m", 0, 1e3),
    number("coupling_angular_stiffness", "Coupling stiffness, rotation", "N m/rad", 0, 1e3),
    number("coupling_angular_damping", "Coupling damping, rotation", "N m s/rad", 0, 10),
  }
end

-- Items of lists.

local link = group("link", "Link of the tool", {
  field(I8, "parent", "Parent link, -1 is the world"),
  code("joint", "Joint", {[0] = "fixed", "revolute", "prismatic", "planar", "free"}),
  pose("X_PJ", "Joint frame in the parent's link frame"),
  vector("axis", "Unit axis in the joint frame"),
  field(F64, "mass", "Mass", "kg"),
  vector("p_LCom", "Centre of mass in the link frame", "m"),
  numbers("I_LCom", "Inertia about the centre of mass, link axes", "kg m²",
          {"xx", "yy", "zz", "xy", "xz", "yz"}),
  field(F64, "lower", "Least position of the joint", "rad or m"),
  field(F64, "upper", "Largest position of the joint", "rad or m"),
})

local ROUNDNESS = {[0] = "none", "axis", "sphere"}

local movable_body = group("movable_body", "Movable body", {
  field(U32, "id", "The environment's number for it"),
  vector("p_WCom", "Centre of mass, world", "m", LENGTH),
  twist("V_W", "Twist of the centre of mass, world", SPEED),
  acceleration("A_W", "Acceleration by all forces except contacts, world"),
  symmetric("W", "Inverse inertia, world [1/kg, 1/(kg m²)]", 6, MOBILITY),
  impulse("P_W", "Total impulse of the tool that this state contains, world", IMPULSE),
  code("roundness", "What turning leaves its shape as it is", ROUNDNESS),
  vector("axis_W", "Axis of revolution, world", nil, between(-2, 2), F32),
})

local PLANE = {[0] = "b", "a"}

local contact = group("contact", "Contact", append(append({
  field(HEX64, "identity", "Identity"),
  field(U32, "pair", "Pair of convex pieces"),
  field(U16, "axis", "Separating axis of the pair"),
}, side_fields()), {
  vector("p_WC", "Point on the surface of b, world", "m", LENGTH),
  normal("n_W", "Unit normal from b to a, world"),
  field(F64, "separation", "True separation", "m", LENGTH),
  vector("v_WC", "Velocity of b's point, world", "m/s", SPEED, F32),
  field(F32, "friction", "Coefficient of friction, negative: the server's", nil,
        between(-10, 10)),
  field(F32, "load", "Normal force of a contact without the tool", "N", between(0, 1e6)),
  code("plane", "Side whose face the plane is", PLANE),
}))

local function force_limit()
  return code("limit", "What limits the command", {[0] = "none", "force", "torque", "rate", "fade",
                                                  "power", "energy"})
end

local tick = group("tick", "Tick", {
  vector("F_env", "Contact force on the hand", "N"),
  vector("F_command", "Force commanded to the device", "N"),
  vector("F_hand", "Force of the hand as known to the controller", "N"),
  field(F64, "torque", "Commanded torque", "N m"),
  field(F64, "smallest_separation", "Smallest separation", "m"),
  field(F64, "device_proxy", "Distance of device and proxy", "m"),
  field(F64, "proxy_tool", "Distance of proxy and tool", "m"),
  field(F64, "lateness", "Lateness", "s"),
  field(F64, "execution", "Execution time of the step before", "s"),
  field(F64, "age", "Age of the newest contacts", "s"),
  field(U16, "active_contacts", "Local contacts with separation <= 0"),
  field(U16, "predicted_contacts", "Local contacts with separation > 0"),
  flag("adopted", "An update was taken"),
  force_limit(),
})

local local_contact = group("local_contact", "Local contact", append(append({
  field(HEX64, "identity", "Identity"),
}, side_fields()), {
  code("state", "State", {[0] = "impending", "colliding", "penetrating", "separating"}),
  flag("retained", "Its load is being released"),
  vector("c_W", "Point of the constraint, world", "m"),
  normal("n_W", "Unit normal from b to a, world"),
  vector("p_W", "Local contact point, world", "m"),
  field(F64, "s", "Separation", "m"),
  vector("f_W", "Force on a, world", "N"),
}))

local body_impulse = group("body_impulse", "Impulse on a body", {
  field(U32, "body", "The environment's number for it"),
  impulse("P_W", "Impulse since the session began, world"),
})

-- Messages: the block of fixed fields, then the lists.

local function list(name, label, most, item)
  return {
    label = label, name = name, most = most, item = item,
    header = group(name, label, {
      field(U16, "first", "Index of the first item in this part"),
      field(U16, "count", "Items in this part"),
      field(U16, "total", "Items in the message"),
      field(U16, "item_size", "Size of an item", "bytes"),
    }),
  }
end

local function message(name, label, fields, lists)
  return {name = name, block = group(name, label, fields), lists = lists or {}}
end

local messages = {
  [HELLO] = message("hello", "Hello", {
    field(HEX64, "nonce", "Nonce of the session asked for"),
    field(F64, "ve_rate", "Nominal step rate of the virtual environment", "Hz"),
    field(F64, "epsilon", "Radius of the ε-active tool", "m"),
    vector("gravity_W", "Acceleration of gravity, world", "m/s²"),
    field(F64, "length", "Characteristic length of the tool", "m"),
    pose("X_LH", "Hand frame in the hand link's frame"),
    field(U8, "hand_link", "Link that the user holds"),
    size("q", MOST_COORDINATES),
    coordinates("q", "Initial configuration q", "m, rad"),
    optional(flag("clears_fault", "A person asks for it: it ends a fault")),
  }, {list("links", "Links of the tool", 16, link)}),

  [WELCOME] = message("welcome", "Welcome", append(append({
    field(HEX64, "nonce", "Nonce of the hello that is answered"),
    field(F64, "servo_rate", "Rate of the local model", "Hz", POSITIVE),
    field(HEX64, "fingerprint", "Of the server's options"),
  }, tuning_fields(false)), {
    field(F64, "silence_time", "Without an update for this long force fades", "s", POSITIVE),
    field(F64, "fade_time", "How long the fade from full force takes", "s", POSITIVE),
    field(F64, "least_update_rate", "Below this force comes and goes", "Hz", POSITIVE),
    group("capabilities", "What the server makes of an update", {
      flag("movable_bodies", "Movable bodies and their contacts"),
      flag("axes", "Only one axis of each pair acts"),
      flag("self_contacts", "Contacts between two links of the tool"),
    }),
    group("device", "Haptic device", {
      field(F64, "max_force", "Rated force, 0 if none", "N", NOT_NEGATIVE),
      field(F64, "max_torque", "Rated torque, 0 if none", "N m", NOT_NEGATIVE),
      field(F64, "max_stiffness", "Rated stiffness, 0 if none", "N/m", NOT_NEGATIVE),
      field(F64, "max_angular_stiffness", "Rated angular stiffness, 0 if none", "N m/rad",
            NOT_NEGATIVE),
      field(F64, "scale", "Metres in the world for each metre of the handle", nil, POSITIVE),
      field(U8, "buttons", "Buttons"),
      flag("gripper", "It measures a gripper's opening"),
      flag("renders_torque", "It renders torque"),
      flag("measures_hand", "The hand's wrench is known"),
      flag("guidable", "A control can hold its hand"),
      text_size("name"),
      text("name", "Name"),
      optional(field(U8, "freedoms", "Directions in which its handle moves, one bit each")),
      optional(flag("observes_hand", "It estimates the hand's wrench")),
    }),
  })),

  [REJECT] = message("reject", "Reject", {
    field(HEX64, "nonce", "Nonce of the hello that is answered"),
    code("reason", "Reason", {"version", "busy", "tool", "fault"}),
    text_size("text"),
    field(U16, "version", "Version that the server speaks"),
    text("text", "Text"),
  }),

  [CONTACT_UPDATE] = message("contact_update", "Contact update", {
    field(F64, "ve_time", "Simulated time of the virtual environment", "s"),
    field(F64, "ve_period", "Length of its latest step", "s", SPAN),
    field(F64, "compute_time", "From sampling q_VE to sending this", "s", SPAN),
    field(U64, "echo_step", "Step of the newest proxy state received, 0 if none"),
    field(F64, "echo_hold", "From the arrival of that proxy state to sending this", "s", SPAN),
    field(F64, "impulse_step", "Step up to which the bodies' state contains the impulses", "",
          NOT_NEGATIVE),
    size("q_VE", MOST_COORDINATES),
    size("v_VE", MOST_VELOCITIES),
    coordinates("q_VE", "Tool configuration q_VE of the contacts", "m, rad", LENGTH),
    coordinates("v_VE", "Its generalised velocity", "m/s, rad/s", SPEED),
  }, {list("bodies", "Movable bodies", 16, movable_body),
      list("contacts", "Contacts", 192, contact)}),

  [PROXY_STATE] = message("proxy_state", "Proxy state", {
    field(U64, "acknowledged", "Sequence of the adopted update"),
    field(U64, "step", "Step of the local model in this session"),
    field(F64, "age", "Age attributed to the update's contacts", "s", NOT_NEGATIVE),
    field(F64, "update_send_time", "Send time of that update, client's clock", "s"),
    field(F64, "hold", "From the arrival of that update to sending this", "s", NOT_NEGATIVE),
    code("server", "Server", {[0] = "off", "active", "fading", "fault", "arming",
                              "ramping"}),
    code("fault", "Fault", {[0] = "none", "non_finite", "overrun", "device", "implausible",
                            "operator_stop", "handle_speed", "workspace", "energy"}),
    code("contact_state", "Proxy", {[0] = "free_motion", "colliding", "resting"}),
    force_limit(),
    field(U16, "active_contacts", "Local contacts with separation <= 0"),
    field(U16, "predicted_contacts", "Local contacts with separation > 0"),
    field(F64, "smallest_separation", "Smallest separation", "m"),
    unit_pose("X_WD", "Device handle in the world"),
    twist("V_WD", "Twist of the device handle, world"),
    wrench("F_env", "Contact wrench at the hand, world"),
    wrench("F_command", "Wrench commanded to the device, world"),
    wrench("F_hand", "Wrench of the hand as known to the controller, world"),
    flag("hand_measured", "F_hand is known"),
    field(U32, "buttons", "Buttons that are down, one bit each"),
    field(F64, "gripper", "Opening of the gripper, 0 closed to 1 open"),
    field(F64, "scale", "Metres in the world for each metre of the handle", nil, POSITIVE),
    field(U64, "overruns", "Periods missed since the server started"),
    field(U64, "updates", "Updates adopted in this session"),
    field(U64, "dropped", "Datagrams dropped since the server started"),
    field(U64, "control", "Sequence of the control in effect, 0 if none"),
    size("q", MOST_COORDINATES),
    size("v", MOST_VELOCITIES),
    coordinates("q", "Configuration q of the proxy", "m, rad"),
    coordinates("v", "Generalised velocity of the proxy", "m/s, rad/s"),
    optional(code("fade", "Fade", {[0] = "none", "client_silent", "contacts_old",
                                   "updates_invalid", "client_left"})),
    optional(field(F64, "given", "Energy given to the hand", "J")),
    optional(field(F64, "taken", "Energy taken from the hand", "J")),
    optional(field(F64, "explained", "Of what was given less what was taken: explained", "J")),
    optional(field(F64, "tank", "Energy that may still be given", "J")),
    optional(field(F64, "brought", "Energy that updates brought into contacts' springs", "J")),
    optional(flag("hand_observed", "F_hand is estimated, not measured")),
    optional(field(F64, "lowered", "Share of the stiffness asked for that is not in effect")),
  }),

  [GOODBYE] = message("goodbye", "Goodbye", {
    code("reason", "Reason", {[0] = "finished", "shutdown"}),
  }),

  [CONTROL] = message("control", "Control", append({
    flag("telemetry", "Ticks and local states are asked for"),
    flag("holds", "The hand of a simulated device is held"),
    unit_pose("X_WTarget", "Where it is held, world", LENGTH),
    flag("tuned", "The following is in effect"),
  }, tuning_fields(true))),

  [TICKS] = message("ticks", "Ticks", {
    field(U64, "first_step", "Step of the first tick", nil, NOT_0),
  }, {list("ticks", "Ticks", 8, tick)}),

  [LOCAL_STATE] = message("local_state", "Local state", {
    field(U64, "step", "Step of the local model"),
  }, {list("contacts", "Local contacts", 64, local_contact)}),

  [REFUSAL] = message("refusal", "Refusal", {
    field(U64, "refused", "Sequence of the update"),
    code("error", "Error", {[0] = "none", "layout", "non_finite", "tool", "quaternion", "range",
                            "normal", "side", "duplicate"}),
    flag("whole", "The update as a whole was refused"),
    field(U16, "item", "Index in the list that the error is in"),
    field(U64, "count", "Updates refused as a whole in this session"),
  }),

  [IMPULSES] = message("impulses", "Impulses", {
    field(U64, "step", "Step of the local model that the totals contain"),
  }, {list("bodies", "Bodies", 16, body_impulse)}),
}

local TYPES = {}
for number, known in pairs(messages) do TYPES[number] = known.name end

-- These three, the nonce of a hello and the whole of a reject are the same in every version.
local stable_fields = {
  {kind = TEXT, name = "magic", label = "Magic", size = #MAGIC},
  field(U16, "version", "Version"),
  code("type", "Type", TYPES),
}
local HEADER_SIZE = 40
local header = group("header", "Header", append(append({}, stable_fields), {
  field(U8, "flags", "Flags"),
  field(HEX64, "session", "Session"),
  field(U64, "sequence", "Sequence"),
  field(I64, "send_time", "Send time by the sender's clock", "ns"),
  field(U8, "part", "Part"),
  field(U8, "parts", "Parts of the message"),
  field(U8, "tool", "Tool"),
  field(U8, "reserved", "Reserved"),
  field(U16, "length", "Length of the datagram", "bytes"),
  field(U16, "block", "Length of the fixed fields", "bytes"),
}))
local other_header = group("other_header", "Header of another version",
                           append(append({}, stable_fields), {
  {kind = BYTES, name = "other", label = "Other fields", size = HEADER_SIZE - 7},
}))

-- Sealed datagrams: their packets, by type.
local SEALING_MAGIC = "HLS"
local KEY_SIZE, INDEX_SIZE, TAG_SIZE = 32, 4, 16

local function bytes(name, label, size) return {kind = BYTES, name = name, label = label, size = size} end
local function handshake_message()
  return {bytes("public_key", "Ephemeral public key", KEY_SIZE),
          bytes("payload", "Index of the sender, sealed", INDEX_SIZE + TAG_SIZE)}
end
local receiver = function() return field(HEX32, "receiver", "Index of the receiver") end

local packets = {
  group("initiation", "First message of a handshake", handshake_message()),
  group("response", "Second message of a handshake", append({receiver()}, handshake_message())),
  group("sealed", "Sealed datagram", {receiver(), field(U64, "counter", "Counter")}),
}
local SEALED = 3
local packet_header = group("packet", "Sealing", {
  {kind = TEXT, name = "magic", label = "Magic", size = #SEALING_MAGIC},
  code("type", "Type", {"initiation", "response", "sealed"}),
})
local sealed_text = bytes("text", "Text, sealed, and its tag")

local newer_fields = {kind = BYTES, name = "newer_fields", label = "Fields of a newer version"}
local newer_lists = {kind = BYTES, name = "newer_lists", label = "Lists of a newer version"}
local newer_message = {kind = BYTES, name = "newer_message", label = "Message of a newer version"}

-- Wireshark's fields are named hlm.<message>.<field>, those of the header and of list items
-- hlm.<field> and hlm.<item>.<field>; a component adds its own name: hlm.contact.n_W.z. A list's
-- own numbers are hlm.<message>.<list>.total and so on.

local declared = {}

local function declare(node, prefix, abbr)
  if node.field then return end
  abbr = abbr or (prefix .. "." .. node.name)
  if node.children then
    node.field = ProtoField.none(prefix .. "." .. node.name, node.label)
    for _, child in ipairs(node.children) do declare(child, abbr) end
  else
    node.field = node.kind.make(abbr, node.label, node.values)
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
