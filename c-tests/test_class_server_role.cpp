/* ModbusServer on a simulated board: what its documentation promises. */
#include "server_checks.h"

fixture each_test = {reset_board, nullptr};

TEST(registers_and_bits_of_arrays_are_served)
{
    uint16_t words[] = {0x1111, 0x2222, 0x3333};
    uint8_t bytes[] = {0x05, 0x80};
    ModbusRegisters holding(words, 100), some(words, 2, 7);
    ModbusBits coils(bytes), inputs(bytes, 3, 20);
    ModbusServer server;
    OK(server.holdingRegisters(holding));
    OK(server.inputRegisters(some));
    OK(server.coils(coils));
    OK(server.discreteInputs(inputs));
    OK(server.begin(17, Serial, 19200));
    expect_response(server, {17, 3, 0, 100, 0, 3}, {17, 3, 6, 0x11, 0x11, 0x22, 0x22, 0x33, 0x33});
    expect_response(server, {17, 3, 0, 99, 0, 1}, {17, 0x83, 2});
    expect_response(server, {17, 3, 0, 101, 0, 3}, {17, 0x83, 2});
    expect_response(server, {17, 4, 0, 8, 0, 1}, {17, 4, 2, 0x22, 0x22});
    expect_response(server, {17, 4, 0, 8, 0, 2}, {17, 0x84, 2});
    expect_response(server, {17, 1, 0, 0, 0, 16}, {17, 1, 2, 0x05, 0x80});
    expect_response(server, {17, 2, 0, 20, 0, 3}, {17, 2, 1, 5});
    expect_response(server, {17, 2, 0, 20, 0, 4}, {17, 0x82, 2});
    assert_int_equal(holding.size(), 3);
    assert_int_equal(holding.address(), 100);
    assert_int_equal(coils.size(), 16);
    assert_int_equal(inputs.size(), 3);
}

TEST(writes_reach_the_arrays)
{
    ModbusRegisterArray<4> registers(10);
    ModbusBitArray<9> coils;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.coils(coils);
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 6, 0, 11, 0xBE, 0xEF}, {17, 6, 0, 11, 0xBE, 0xEF});
    assert_int_equal(registers[1], 0xBEEF);
    expect_response(server, {17, 16, 0, 12, 0, 2, 4, 1, 2, 3, 4}, {17, 16, 0, 12, 0, 2});
    assert_int_equal(registers[2], 0x0102);
    assert_int_equal(registers[3], 0x0304);
    expect_response(server, {17, 16, 0, 13, 0, 2, 4, 9, 9, 9, 9}, {17, 0x90, 2});
    assert_int_equal(registers[3], 0x0304); // unchanged: a refused write writes no register
    expect_response(server, {17, 5, 0, 8, 0xFF, 0}, {17, 5, 0, 8, 0xFF, 0});
    assert_true(coils[8]);
    expect_response(server, {17, 15, 0, 1, 0, 3, 1, 5}, {17, 15, 0, 1, 0, 3});
    assert_true(coils[1] && !coils[2] && coils[3]);
    expect_response(server, {17, 5, 0, 8, 0x12, 0}, {17, 0x85, 3});
    expect_response(server, {17, 5, 0, 9, 0, 0}, {17, 0x85, 2});
}

TEST(a_sketch_sets_what_a_client_reads)
{
    ModbusRegisterArray<2> readings;
    ModbusBitArray<10> inputs;
    ModbusServer server;
    server.inputRegisters(readings);
    server.discreteInputs(inputs);
    server.begin(1, Serial, 19200);
    expect_response(server, {1, 4, 0, 0, 0, 2}, {1, 4, 4, 0, 0, 0, 0});
    readings[1] = 513;
    inputs.set(9, true);
    inputs.set(1, true);
    inputs.set(2, true);
    inputs.set(1, false);
    expect_response(server, {1, 4, 0, 0, 0, 2}, {1, 4, 4, 0, 0, 2, 1});
    expect_response(server, {1, 2, 0, 0, 0, 10}, {1, 2, 2, 4, 2});
    const ModbusRegisters &same = readings;
    assert_int_equal(same[1], 513);
}

static uint16_t written_address, written_quantity, written_count;

TEST(one_hook_refuses_a_write_and_another_is_called_after_it)
{
    ModbusRegisterArray<4> registers(10);
    ModbusServer server;
    written_count = 0;
    ModbusHooks hooks;
    hooks.beforeWrite([](const mbm_access &access) -> uint8_t {
        assert_int_equal(access.address, 11);
        assert_int_equal(access.quantity, 1);
        return access.data[0] > 0x10 ? 4 : 0;
    });
    hooks.afterWrite([](const mbm_access &access) {
        written_address = access.address;
        written_quantity = access.quantity;
        written_count++;
    });
    registers.setHooks(hooks);
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 6, 0, 11, 0x11, 0}, {17, 0x86, 4});
    assert_int_equal(registers[1], 0);
    assert_int_equal(written_count, 0);
    expect_response(server, {17, 6, 0, 11, 0x10, 0}, {17, 6, 0, 11, 0x10, 0});
    assert_int_equal(registers[1], 0x1000);
    assert_int_equal(written_count, 1);
    assert_int_equal(written_address, 11);
    assert_int_equal(written_quantity, 1);
    hooks.beforeWrite(nullptr);
    expect_response(server, {17, 6, 0, 10, 0x11, 0}, {17, 6, 0, 10, 0x11, 0});
    assert_int_equal(written_count, 2);
    hooks.afterWrite(nullptr);
    expect_response(server, {17, 6, 0, 10, 0x12, 0}, {17, 6, 0, 10, 0x12, 0});
    assert_int_equal(written_count, 2);
    hooks.beforeRead([](const mbm_access &access) -> uint8_t {
        assert_int_equal(access.unit, 17);
        assert_int_equal(access.function, 3);
        return access.quantity == 2 ? 6 : 0;
    });
    expect_response(server, {17, 3, 0, 10, 0, 2}, {17, 0x83, 6});
    expect_response(server, {17, 3, 0, 10, 0, 1}, {17, 3, 2, 0x12, 0});
    registers.removeHooks();
    expect_response(server, {17, 3, 0, 12, 0, 2}, {17, 3, 4, 0, 0, 0, 0});
}

TEST(absent_registers_and_bits_are_refused)
{
    static const uint8_t valid[] = {0x05};
    ModbusRegisterArray<3> registers;
    ModbusServer server;
    registers.setValid(valid);
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 3, 0, 2, 0, 1}, {17, 3, 2, 0, 0});
    expect_response(server, {17, 3, 0, 0, 0, 3}, {17, 0x83, 2});
}

TEST(mask_write_and_read_write_are_served_after_maskAndReadWrite)
{
    ModbusRegisterArray<4> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    registers[0] = 0x0012;
    expect_response(server, {17, 22, 0, 0, 0, 0xF2, 0, 0x25}, {17, 0x96, 1});
    OK(server.maskAndReadWrite(registers));
    expect_response(server, {17, 22, 0, 0, 0, 0xF2, 0, 0x25}, {17, 22, 0, 0, 0, 0xF2, 0, 0x25});
    assert_int_equal(registers[0], 0x0017);
    expect_response(server, {17, 23, 0, 0, 0, 2, 0, 1, 0, 1, 2, 7, 8}, {17, 23, 4, 0, 0x17, 7, 8});
}

TEST(a_unit_without_tables_sends_no_response)
{
    ModbusServer server;
    server.begin(17, Serial, 19200);
    expect_no_response(server, adu({17, 3, 0, 0, 0, 1}));
}

TEST(each_of_several_units_serves_its_own_tables)
{
    ModbusUnit units[2] = {{5}, {6}};
    ModbusRegisterArray<1> left, right;
    ModbusServer server;
    units[0].holdingRegisters(left);
    units[1].holdingRegisters(right);
    OK(server.begin(units, Serial, 19200));
    expect_response(server, {5, 6, 0, 0, 0, 5}, {5, 6, 0, 0, 0, 5});
    expect_response(server, {6, 6, 0, 0, 0, 6}, {6, 6, 0, 0, 0, 6});
    assert_int_equal(left[0], 5);
    assert_int_equal(right[0], 6);
    expect_no_response(server, adu({1, 6, 0, 0, 0, 7}));
    expect_no_response(server, adu({0, 6, 0, 0, 0, 8}));
    assert_int_equal(left[0], 8);
    assert_int_equal(right[0], 8);
    units[1].setUnitID(9);
    assert_int_equal(units[1].getUnitID(), 9);
    expect_response(server, {9, 3, 0, 0, 0, 1}, {9, 3, 2, 0, 8});
    expect_no_response(server, adu({6, 3, 0, 0, 0, 1}));
}

TEST(a_unit_id_above_255_is_refused)
{
    ModbusServer server;
    ModbusRegisterArray<2> holding;
    ModbusUnit units[2];
    units[1].setUnitID(300);
    server.holdingRegisters(holding);
    OK(server.begin(7, Serial, 19200));
    IS(MBM_INVALID_ARGUMENT, server.begin(263, Serial, 19200));
    IS(MBM_INVALID_ARGUMENT, server.beginAscii(256, Serial));
    IS(MBM_INVALID_ARGUMENT, server.begin(units, Serial, 19200));
    assert_int_equal(server.getUnitID(), 7);
    expect_response(server, {7, 3, 0, 0, 0, 1}, {7, 3, 2, 0, 0});
}

static uint16_t adds(const mbm_request &request, uint8_t *response, uint16_t capacity)
{
    if (request.length != 2 || capacity < 1)
        return MBM_REPLY_EXCEPTION | MBM_ILLEGAL_DATA_VALUE;
    if (request.data[0] == 0xFF)
        return MBM_REPLY_NONE;
    response[0] = static_cast<uint8_t>(request.data[0] + request.data[1]);
    return 1;
}

TEST(a_function_of_the_sketch_is_served)
{
    ModbusFunction sum(65, adds), none(66, nullptr);
    ModbusServer server;
    OK(server.function(sum));
    IS(MBM_INVALID_ARGUMENT, server.function(none));
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 65, 3, 4}, {17, 65, 7});
    expect_response(server, {17, 65, 3}, {17, 65 | 0x80, 3});
    expect_no_response(server, adu({17, 65, 0xFF, 1}));
    expect_response(server, {17, 66, 3, 4}, {17, 66 | 0x80, 1});
}

TEST(a_function_can_be_switched_off_and_on)
{
    mbm_functionMask switches = {};
    ModbusRegisterArray<1> registers;
    ModbusServer server;
    server.holdingRegisters(registers);
    server.begin(17, Serial, 19200);
    OK(server.switchOff(switches, 6));
    expect_response(server, {17, 6, 0, 0, 0, 9}, {17, 0x86, 1});
    expect_response(server, {17, 3, 0, 0, 0, 1}, {17, 3, 2, 0, 0});
    OK(server.switchOn(switches, 6));
    expect_response(server, {17, 6, 0, 0, 0, 9}, {17, 6, 0, 0, 0, 9});
}

static uint16_t address_itself(void *, uint16_t address)
{
    return address;
}

TEST(the_other_functions_are_served_from_their_records)
{
    static const uint8_t name[] = {'m', 'b', 'm'};
    static uint16_t records[] = {1, 2};
    static const uint16_t queued[] = {8, 9};
    mbm_exceptionStatus status = {};
    mbm_diagnostics diagnostics = {};
    mbm_serverId id = {};
    mbm_file file = {records, 2, 4};
    mbm_files files = {};
    mbm_fifo fifo = {queued, 30, 2};
    mbm_fifos fifos = {};
    mbm_object object = {};
    mbm_serverIdentification identification = {};
    mbm_dataCallbacks cells = {};
    ModbusServer server;
    status.outputs = 0x6D;
    id.id = name;
    id.idLength = 3;
    id.running = 1;
    files.files = &file;
    files.count = 1;
    fifos.fifos = &fifo;
    fifos.count = 1;
    object.data = name;
    object.length = 3;
    identification.objects = &object;
    identification.count = 1;
    cells.get = address_itself;
    OK(server.serve(status));
    OK(server.serve(diagnostics));
    OK(server.serve(id));
    OK(server.serve(files));
    OK(server.serve(fifos));
    OK(server.serve(identification));
    OK(server.serve(cells, 4));
    server.begin(17, Serial, 19200);
    expect_response(server, {17, 7}, {17, 7, 0x6D});
    expect_response(server, {17, 8, 0, 0, 0xA5, 0x37}, {17, 8, 0, 0, 0xA5, 0x37});
    expect_response(server, {17, 17}, {17, 17, 4, 'm', 'b', 'm', 0xFF});
    expect_response(server, {17, 20, 7, 6, 0, 4, 0, 1, 0, 1}, {17, 20, 4, 3, 6, 0, 2});
    expect_response(server, {17, 24, 0, 30}, {17, 24, 0, 6, 0, 2, 0, 8, 0, 9});
    expect_response(server, {17, 43, 14, 4, 0},
                    {17, 43, 14, 4, 0x81, 0, 0, 1, 0, 3, 'm', 'b', 'm'});
    expect_response(server, {17, 4, 0x12, 0x34, 0, 1}, {17, 4, 2, 0x12, 0x34});
}

/* The two ends of a wire. Each is a Stream. */
class Loop : public Stream {
public:
    Loop *far = nullptr;
    std::deque<uint8_t> arrived;

    int available() override { return static_cast<int>(arrived.size()); }
    int read() override
    {
        if (arrived.empty())
            return -1;
        uint8_t value = arrived.front();
        arrived.pop_front();
        return value;
    }
    int peek() override { return arrived.front(); }
    size_t write(uint8_t value) override
    {
        far->arrived.push_back(value);
        return 1;
    }
};

TEST(master_and_server_understand_each_other)
{
    static ModbusServer server;
    ModbusRegisterArray<125> registers, inputs;
    ModbusBitArray<2000> coils;
    ModbusMaster node;
    Loop left, right;
    left.far = &right;
    right.far = &left;
    server.holdingRegisters(registers);
    server.maskAndReadWrite(registers);
    server.inputRegisters(inputs);
    server.coils(coils);
    server.begin(17, right, 19200);
    node.begin(17, left);
    node.setBaudRate(19200);
    node.idle([] { server.poll(); });
    for (uint16_t i = 0; i < 125; i++)
        inputs[i] = static_cast<uint16_t>(i * 517);
    assert_int_equal(node.readInputRegisters(0, 125), 0);
    for (uint8_t i = 0; i < 125; i++)
        assert_int_equal(node.getResponseBuffer(i), i * 517);
    assert_int_equal(node.writeSingleRegister(3, 0xBEEF), 0);
    assert_int_equal(registers[3], 0xBEEF);
    assert_int_equal(node.maskWriteRegister(3, 0xFF00, 0x0055), 0);
    assert_int_equal(registers[3], 0xBE55);
    node.beginTransmission(50);
    node.send(uint32_t(0x11223344));
    assert_int_equal(node.readWriteMultipleRegisters(3, 1), 0);
    assert_int_equal(node.getResponseBuffer(0), 0xBE55);
    assert_int_equal(registers[51], 0x1122);
    node.setTransmitBuffer(0, 0xA5C3);
    assert_int_equal(node.writeMultipleCoils(1990, 10), 0);
    assert_int_equal(node.readCoils(1984, 16), 0);
    assert_int_equal(node.getResponseBuffer(0), (0xA5C3 & 0x3FF) << 6 & 0xFFFF);
    assert_int_equal(node.writeSingleCoil(2000, 1), ModbusMaster::ku8MBIllegalDataAddress);
    assert_int_equal(node.readDiscreteInputs(0, 1), ModbusMaster::ku8MBIllegalFunction);
}
