// Runs a program for the RP2040 in the emulator rp2040js:
//
//   node run.mjs IMAGE.elf usb|stock-usb|uart|loop [ROM.elf]
//
// Standard input and output are the program's line: its USB, or its UART 1. Standard error says "ready" once
// the line is open, and at the end of standard input how much stack the program took, and how many
// cycles each interrupt. `stock-usb` is the emulator's own USB host. With `loop` UART 1's TX is wired to its RX, and standard output
// is UART 0. Signals: SIGUSR1 pulls the cable, SIGUSR2 plugs it in.
import { readFileSync, writeSync } from 'node:fs';
import { ConsoleLogger, LogLevel, Simulator, USBCDC } from 'rp2040js';
import { UsbHost } from './usb_host.mjs';

const [image, line, rom] = process.argv.slice(2);
const FLASH = 0x10000000;
const CYCLE = 1e9 / 125e6; // in nanoseconds
const STACK = 0x20042000; // the end of it, in pico-sdk's layout
// The most cycles between two looks at the line.
const ROUND = 50000;

/** Copies the segments of an image that lie in a memory. */
function load(name, begin, memory) {
    const elf = readFileSync(name);
    for (let i = 0, at = elf.readUInt32LE(28); i < elf.readUInt16LE(44); i++, at += elf.readUInt16LE(42)) {
        const [kind, offset, , to, size] = [0, 4, 8, 12, 16].map((field) => elf.readUInt32LE(at + field));
        if (kind === 1 && to >= begin && to < begin + memory.length) memory.set(elf.subarray(offset, offset + size), to - begin);
    }
}

const simulator = new Simulator();
const chip = simulator.rp2040;
// Lower levels are printed on standard output, which is the line.
chip.logger = new ConsoleLogger(LogLevel.Error);
const say = (text) => process.stderr.write(`${text}\n`);
const out = (bytes) => { for (let at = 0; at < bytes.length;) at += writeSync(1, Uint8Array.from(bytes), at); };
if (rom) {
    const bytes = new Uint8Array(16384);
    load(rom, 0, bytes);
    chip.loadBootrom(new Uint32Array(bytes.buffer));
}
load(image, FLASH, chip.flash);
// As the boot ROM leaves it.
chip.core.SP = 0x20041f00;
chip.core.LR = 0;
chip.core.PC = FLASH;

let send;
if (line === 'usb') {
    const host = new UsbHost(chip, out, () => say('ready'));
    process.on('SIGUSR1', () => { host.unplug(); say('unplugged'); });
    process.on('SIGUSR2', () => host.plug());
    send = (bytes) => host.send(bytes);
} else if (line === 'stock-usb') {
    const host = new USBCDC(chip.usbCtrl);
    host.onDeviceConnected = () => say('ready');
    host.onSerialData = out;
    send = (bytes) => bytes.forEach((byte) => host.sendSerialByte(byte));
} else {
    // The UART sends at once and never says that it is busy. Its FIFO is filled as fast as the rate allows.
    const uart = chip.uart[1];
    const queue = [];
    const character = simulator.clock.createAlarm(() => {
        uart.feedByte(queue.shift());
        if (queue.length) character.schedule(11e9 / uart.baudRate);
    });
    uart.onByte = line === 'loop' ? (byte) => send([byte]) : (byte) => out([byte]);
    if (line === 'loop') chip.uart[0].onByte = (byte) => out([byte]);
    send = (bytes) => {
        if (!queue.length) character.schedule(11e9 / uart.baudRate);
        queue.push(...bytes);
    };
    setImmediate(() => say('ready'));
}
process.stdin.on('data', (bytes) => send(bytes));
process.stdin.on('end', () => {
    say(`stack ${STACK - lowest}`);
    for (const [number, { cycles, calls }] of handlers) say(`interrupt ${number - 16} ${cycles} cycles ${calls} calls`);
    process.exit(0);
});

/** What the program took, for scripts/bench/kits: the lowest place of its stack, and the cycles in each interrupt's handler. */
let lowest = STACK;
const handlers = new Map();
function note(core, before, cycles) {
    lowest = Math.min(lowest, core.SP);
    const number = core.IPSR || before;
    if (!number) return;
    if (!handlers.has(number)) handlers.set(number, { cycles: 0, calls: 0 });
    const of = handlers.get(number);
    of.cycles += cycles;
    if (!before) of.calls++;
}

function round() {
    const { core, clock } = { core: chip.core, clock: simulator.clock };
    for (let cycles = 0; cycles < ROUND;) {
        let spent;
        if (core.waiting) {
            spent = Math.max(1, clock.nanosToNextAlarm / CYCLE);
        } else {
            const before = core.IPSR;
            spent = core.executeInstruction();
            note(core, before, spent);
        }
        clock.tick(spent * CYCLE);
        cycles += spent;
    }
    setImmediate(round);
}
round();
