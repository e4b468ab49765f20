-- Wireshark dissector: every field of every message, as protocol/PROTOCOL.md lays them out.
-- wireshark -X lua_script:scripts/wireshark/haptic.lua, or copy it to the personal plugins folder.

local PORT = 47800
local VERSION = 1
local MAGIC = "HLMI"
local LARGEST_DATAGRAM = 1200
local HELLO, WELCOME, REJECT, CONTACT_UPDATE, PROXY_STATE, GOODBYE = 1, 2, 3, 4, 5, 6
local CONTROL, TICKS, LOCAL_STATE = 7, 8, 9

local haptic = Proto("hlm", "Haptic local model")
local malformed = ProtoExpert.new("hlm.malformed", "Not as the protocol demands",
                                  expert.group.MALFORMED, expert.severity.ERROR)
local other_version = ProtoExpert.new("hlm.other_version", "Another version of the protocol",
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

local U8 = {size = 1, make = make_plain(ProtoField.uint8), read = read_unsigned}
local I8 = {size = 1, make = make_plain(ProtoField.int8), read = read_signed}
local U16 = {size = 2, make = make_plain(ProtoField.uint16), read = read_unsigned}
local U32 = {size = 4, make = make_plain(ProtoField.uint32), read = read_unsigned}
local U64 = {size = 8, make = make_plain(ProtoField.uint64),
             read = function(range) return range:le_uint64() end}
local I64 = {size = 8, make = make_plain(ProtoField.int64),
             read = function(range) return range:le_int64() end}
local HEX64 = {size = 8, make = make_hex, read = U64.read}
local F64 = {size = 8, make = make_plain(ProtoField.double),
             read = function(range) return range:le_float() end}
local CODE = {size = 1, make = make_code, read = read_unsigned}
local TEXT = {make = make_plain(ProtoField.string),
              read = function(range) return range:string(ENC_UTF_8) end}

-- Layouts: lists of fields in the order of their bytes. `count` names an earlier field that says
-- how often this one is repeated; `length` one that says how many bytes it has.

local function field(kind, name, label, unit)
  return {kind = kind, name = name, label = unit and (label .. " [" .. unit .. "]") or label}
end

local function code(name, label, values)
  return {kind = CODE, name = name, label = label, values = values}
end

local function coordinates(name, label, unit)
  local node = field(F64, name, label, unit)
  node.count = "size_" .. name
  return node
end

local function group(name, label, children)
  return {name = name, label = label, children = children}
end

local function numbers(name, label, unit, components)
  local children = {}
  for _, component in ipairs(components) do
    table.insert(children, field(F64, component, component, unit))
  end
  return group(name, label, children)
end

local function vector(name, label, unit) return numbers(name, label, unit, {"x", "y", "z"}) end

local function pose(name, label)
  return group(name, label, {
    vector("p", "Position", "m"),
    numbers("R", "Rotation, a unit quaternion", nil, {"w", "x", "y", "z"}),
  })
end

local function twist(name, label)
  return group(name, label, {
    vector("linear", "Linear velocity", "m/s"),
    vector("angular", "Angular velocity", "rad/s"),
  })
end

local function wrench(name, label)
  return group(name, label, {vector("force", "Force", "N"), vector("torque", "Torque", "N m")})
end

local function feature(name, label)
  return group(name, label, {
    code("kind", "Kind", {[0] = "vertex", [1] = "edge", [2] = "face"}),
    field(U8, "shape", "Convex shape of the body"),
    field(U16, "index", "Vertex, edge or face of the shape"),
  })
end

local TYPES = {
  [HELLO] = "hello", [WELCOME] = "welcome", [REJECT] = "reject",
  [CONTACT_UPDATE] = "contact update", [PROXY_STATE] = "proxy state", [GOODBYE] = "goodbye",
  [CONTROL] = "control", [TICKS] = "ticks", [LOCAL_STATE] = "local state",
}

local header = group("header", "Header", {
  {kind = TEXT, name = "magic", label = "Magic", size = #MAGIC},
  field(U16, "version", "Version"),
  code("type", "Type", TYPES),
  field(U8, "flags", "Flags"),
  field(HEX64, "session", "Session"),
  field(U64, "sequence", "Sequence"),
  field(I64, "send_time", "Send time by the sender's clock", "ns"),
  field(U8, "part", "Part"),
  field(U8, "parts", "Parts of the message"),
  field(U8, "items", "List items in this part"),
  field(U8, "items_total", "List items in the message"),
  field(U16, "length", "Length of the datagram", "bytes"),
  field(U16, "reserved", "Reserved"),
})

local link = group("link", "Link of the tool", {
  field(I8, "parent", "Parent link, -1 is the world"),
  code("joint", "Joint", {[0] = "fixed", [1] = "revolute", [2] = "prismatic", [3] = "planar",
                          [4] = "free"}),
  pose("X_PJ", "Joint frame in the parent's link frame"),
  vector("axis", "Unit axis in the joint frame"),
  field(F64, "mass", "Mass", "kg"),
  vector("p_LCom", "Centre of mass in the link frame", "m"),
  numbers("I_LCom", "Inertia about the centre of mass, link axes", "kg m²",
          {"xx", "yy", "zz", "xy", "xz", "yz"}),
})

local contact = group("contact", "Contact", {
  field(U16, "link", "Link of the tool"),
  feature("tool_feature", "Feature of the link"),
  field(U32, "body", "Body of the virtual environment"),
  feature("body_feature", "Feature of the body"),
  vector("p_WC", "Point on the environment, world", "m"),
  vector("n_W", "Unit normal from the environment to the tool, world"),
  field(F64, "separation", "True separation", "m"),
  vector("v_WC", "Velocity of the environment's point, world", "m/s"),
})

local function force_limit()
  return code("limit", "What limits the command",
              {[0] = "nothing", [1] = "force", [2] = "torque", [3] = "rate", [4] = "fade"})
end

local function flag(name, label) return code(name, label, {[0] = "no", [1] = "yes"}) end

local function append(list, more)
  for _, item in ipairs(more) do table.insert(list, item) end
  return list
end

local function tuning_fields()
  return {
    code("update_rule", "Update rule", {[0] = "retain", [1] = "paper",
                                        [2] = "intermediate representation",
                                        [3] = "plane recovery"}),
    code("controller", "Controller", {[0] = "four-channel", [1] = "three-channel",
                                      [2] = "virtual coupler", [3] = "direct",
                                      [4] = "rotation coupler", [5] = "engine coupler",
                                      [6] = "engine force"}),
    field(F64, "stiffness", "Stiffness of each contact", "N/m"),
    field(F64, "damping", "Damping of each contact", "N s/m"),
    field(F64, "friction", "Coefficient of friction"),
    field(F64, "restitution", "Coefficient of restitution"),
    field(F64, "coupling_stiffness", "Coupling stiffness", "N/m"),
    field(F64, "coupling_damping", "Coupling damping", "N s/m"),
    field(F64, "coupling_angular_stiffness", "Coupling stiffness, rotation", "N m/rad"),
    field(F64, "coupling_angular_damping", "Coupling damping, rotation", "N m s/rad"),
  }
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

local local_contact = group("local_contact", "Local contact", {
  field(U16, "link", "Link of the tool"),
  code("state", "State", {[0] = "impending", [1] = "colliding", [2] = "penetrating",
                          [3] = "separating"}),
  flag("retained", "Its load is being released"),
  vector("c_W", "Point of the constraint, world", "m"),
  vector("n_W", "Unit normal, world"),
  vector("p_W", "Local contact point, world", "m"),
  field(F64, "s", "Separation", "m"),
  vector("f_W", "Force on the tool, world", "N"),
})

-- `list`: the item, how many of them a message may have, and how many each part but the last has.
local messages = {
  [HELLO] = {
    list = {item = link, fewest = 1, most = 16, per_part = 5},
    body = group("hello", "Hello", {
      field(HEX64, "nonce", "Nonce of the session asked for"),
      field(F64, "ve_rate", "Nominal step rate of the virtual environment", "Hz"),
      field(F64, "epsilon", "Radius of the ε-active tool", "m"),
      vector("gravity_W", "Acceleration of gravity, world", "m/s²"),
      field(F64, "length", "Characteristic length of the tool", "m"),
      pose("X_LH", "Hand frame in the hand link's frame"),
      field(U8, "hand_link", "Link that the user holds"),
      field(U8, "size_q", "Coordinates of q"),
      coordinates("q", "Initial configuration q", "m, rad"),
    }),
  },
  [WELCOME] = {
    body = group("welcome", "Welcome", append(append({
      field(HEX64, "nonce", "Nonce of the hello that is answered"),
      field(F64, "servo_rate", "Rate of the local model", "Hz"),
      field(HEX64, "configuration", "Fingerprint of the server's configuration"),
    }, tuning_fields()), {flag("guidable", "A control can hold the hand of the device")})),
  },
  [REJECT] = {
    body = group("reject", "Reject", {
      field(HEX64, "nonce", "Nonce of the hello that is answered"),
      code("reason", "Reason", {[1] = "version", [2] = "busy", [3] = "tool"}),
      field(U8, "size_text", "Bytes of the text"),
      field(U16, "version", "Version that the server speaks"),
      {kind = TEXT, name = "text", label = "Text", length = "size_text"},
    }),
  },
  [CONTACT_UPDATE] = {
    list = {item = contact, fewest = 0, most = 64, per_part = 9},
    body = group("contact_update", "Contact update", {
      field(F64, "ve_time", "Simulated time of the virtual environment", "s"),
      field(F64, "ve_period", "Length of its latest step", "s"),
      field(F64, "compute_time", "From sampling q_VE to sending this", "s"),
      field(U64, "echo_step", "Step of the newest proxy state received, 0 if none"),
      field(F64, "echo_hold", "From receiving that proxy state to sending this", "s"),
      field(U8, "size_q_VE", "Coordinates of q_VE"),
      field(U8, "size_v_VE", "Coordinates of v_VE"),
      coordinates("q_VE", "Tool configuration q_VE of the contacts", "m, rad"),
      coordinates("v_VE", "Its generalised velocity", "m/s, rad/s"),
    }),
  },
  [PROXY_STATE] = {
    body = group("proxy_state", "Proxy state", {
      field(U64, "acknowledged", "Sequence of the adopted update"),
      field(U64, "step", "Step of the local model in this session"),
      field(F64, "age", "Age attributed to the update's contacts", "s"),
      field(F64, "update_send_time", "Send time of that update, client's clock", "s"),
      field(F64, "hold", "From receiving that update to sending this", "s"),
      code("server", "Server", {[0] = "idle", [1] = "running", [2] = "silent", [3] = "fault"}),
      code("fault", "Fault", {[0] = "none", [1] = "not finite", [2] = "overrun", [3] = "device"}),
      code("contact_state", "Proxy",
           {[0] = "free motion", [1] = "colliding", [2] = "resting"}),
      field(U8, "size_q", "Coordinates of q"),
      field(U8, "size_v", "Coordinates of v"),
      field(U16, "active_contacts", "Local contacts with separation <= 0"),
      field(U16, "predicted_contacts", "Local contacts with separation > 0"),
      field(F64, "smallest_separation", "Smallest separation", "m"),
      pose("X_WD", "Device handle in the world"),
      twist("V_WD", "Twist of the device handle, world"),
      wrench("F_env", "Contact wrench at the hand, world"),
      wrench("F_command", "Wrench commanded to the device, world"),
      wrench("F_hand", "Wrench of the hand as known to the controller, world"),
      field(U64, "overruns", "Periods missed since the server started"),
      field(U64, "updates", "Updates adopted in this session"),
      field(U64, "dropped", "Datagrams dropped since the server started"),
      field(U64, "control", "Sequence of the control in effect, 0 if none"),
      coordinates("q", "Configuration q of the proxy", "m, rad"),
      coordinates("v", "Generalised velocity of the proxy", "m/s, rad/s"),
    }),
  },
  [GOODBYE] = {
    body = group("goodbye", "Goodbye", {
      code("reason", "Reason", {[0] = "finished", [1] = "shutdown"}),
    }),
  },
}

messages[CONTROL] = {
  body = group("control", "Control", append({
    flag("telemetry", "Ticks and local states are asked for"),
    flag("holds", "The hand of a simulated device is held"),
    pose("X_WTarget", "Where it is held, world"),
    flag("tuned", "The following is in effect"),
  }, tuning_fields())),
}
messages[TICKS] = {
  list = {item = tick, fewest = 1, most = 8, per_part = 8},
  body = group("ticks", "Ticks", {field(U64, "first_step", "Step of the first tick")}),
}
messages[LOCAL_STATE] = {
  list = {item = local_contact, fewest = 0, most = 64, per_part = 10},
  body = group("local_state", "Local state", {
    field(U64, "step", "Step of the local model"),
    force_limit(),
  }),
}

-- Wireshark's fields are named hlm.<message>.<field>, those of the header and of list items
-- hlm.<field> and hlm.<item>.<field>; a component adds its own name: hlm.contact.n_W.z.

local declared = {}

local function declare(node, prefix, abbr)
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
for _, message in pairs(messages) do
  declare(message.body, "hlm")
  if message.list then declare(message.list.item, "hlm") end
end
haptic.fields = declared
haptic.experts = {malformed, other_version}

-- Dissection. A cursor walks over the datagram and remembers the values of its fields by name.

local function complain(tree, text) tree:add_proto_expert_info(malformed, text) end

-- The next `size` bytes; nil, and no field after it is dissected, where the datagram ends before.
local function take(cursor, size, tree, name)
  if cursor.ended then return nil end
  if cursor.offset + size > cursor.tvb:len() then
    cursor.ended = true
    if cursor.tvb:len() == cursor.tvb:reported_len() then
      complain(tree, "The datagram ends before or within " .. name)
    end
    return nil
  end
  local range = cursor.tvb(cursor.offset, size)
  cursor.offset = cursor.offset + size
  return range
end

local function is_finite(number) return number - number == 0 end

local function dissect_leaf(node, cursor, tree)
  local size = node.kind.size or node.size or cursor.values[node.length]
  if size == 0 then return end
  local range = take(cursor, size, tree, node.name)
  if not range then return end
  local value = node.kind.read(range)
  cursor.values[node.name] = value
  local item
  if node.kind == TEXT then
    item = tree:add(node.field, range, value)
  else
    item = tree:add_le(node.field, range)
  end
  if node.kind == F64 and not is_finite(value) then
    complain(item, node.name .. " is not finite")
  end
  if node.values and not node.values[value] then complain(item, node.name .. " is unknown") end
end

local function dissect(node, cursor, tree)
  if cursor.ended then return end
  if node.children then
    local start = cursor.offset
    if start >= cursor.tvb:len() then
      take(cursor, 1, tree, node.name)
      return
    end
    local subtree = tree:add(node.field, cursor.tvb(start))
    for _, child in ipairs(node.children) do dissect(child, cursor, subtree) end
    subtree:set_len(cursor.offset - start)
  else
    local count = node.count and cursor.values[node.count] or 1
    for _ = 1, count do dissect_leaf(node, cursor, tree) end
  end
end

-- Why the header cannot be one of this message; nil if it can.
local function find_header_error(head, message, length)
  if head.length ~= length then
    return string.format("The length field says %d bytes, the datagram has %d", head.length,
                         length)
  end
  if length > LARGEST_DATAGRAM then return "Longer than " .. LARGEST_DATAGRAM .. " bytes" end
  if head.flags ~= 0 or head.reserved ~= 0 then return "Flags or reserved bytes are not 0" end
  if head.sequence == UInt64(0) then return "Sequence 0" end
  local outside_sessions = head.type == HELLO or head.type == REJECT
  if (head.session == UInt64(0)) ~= outside_sessions then
    return "Session 0 belongs to hello and reject, and to them alone"
  end
  local list = message.list or {fewest = 0, most = 0, per_part = 1}
  local total = head.items_total
  if total < list.fewest or total > list.most then return "Number of list items not allowed" end
  if head.parts ~= math.max(1, math.ceil(total / list.per_part)) then
    return "Number of parts does not fit the list"
  end
  if head.part >= head.parts then return "Part beyond the last" end
  if head.items ~= math.min(list.per_part, total - head.part * list.per_part) then
    return "Number of list items does not fit the part"
  end
  return nil
end

local function dissect_message(message, items, cursor, tree)
  dissect(message.body, cursor, tree)
  if message.list then
    for _ = 1, items do dissect(message.list.item, cursor, tree) end
  end
  local rest = cursor.tvb:reported_len() - cursor.offset
  if not cursor.ended and rest > 0 then complain(tree, rest .. " bytes are left over") end
end

local function describe(head)
  local text = string.format("%s %s", TYPES[head.type] or "unknown type " .. head.type,
                             tostring(head.sequence))
  if head.parts > 1 then
    text = text .. string.format(", part %d of %d", head.part + 1, head.parts)
  end
  if head.type == CONTACT_UPDATE then
    text = text .. string.format(", contacts %d", head.items_total)
  end
  return text
end

-- Returns the number of bytes dissected; 0 if the datagram is not of this protocol.
local function dissect_datagram(tvb, pinfo, root)
  if tvb:len() < #MAGIC or tvb(0, #MAGIC):string() ~= MAGIC then return 0 end
  pinfo.cols.protocol = "HLM"
  local tree = root:add(haptic, tvb())
  local cursor = {tvb = tvb, offset = 0, values = {}, ended = false}
  dissect(header, cursor, tree)
  if cursor.ended then return tvb:len() end

  local head = cursor.values
  cursor.values = {}
  pinfo.cols.info = describe(head)
  -- A reject is the same in every version.
  if head.version ~= VERSION and head.type ~= REJECT then
    tree:add_proto_expert_info(other_version)
    return tvb:len()
  end
  local message = messages[head.type]
  if not message then return tvb:len() end
  local reason = find_header_error(head, message, tvb:reported_len())
  if reason then complain(tree, reason) end
  dissect_message(message, head.items, cursor, tree)
  if cursor.values.acknowledged then
    pinfo.cols.info:append(", acknowledges " .. tostring(cursor.values.acknowledged))
  end
  return tvb:len()
end

haptic.dissector = dissect_datagram
DissectorTable.get("udp.port"):add(PORT, haptic)

-- On any other port, by the magic.
haptic:register_heuristic("udp", function(tvb, pinfo, root)
  return dissect_datagram(tvb, pinfo, root) > 0
end)
