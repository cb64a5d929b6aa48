// A sign in the room of a headset, where no page is seen: the force of a hand, and what it is worth.
import * as THREE from "three";
import type { Reading } from "./pointer";

const [WIDTH, HEIGHT] = [512, 128];
/** Its width in the room, and its height above the force's far end [m]. */
const WIDE = 0.24;
const ABOVE = 0.05;
const COLOURS = { sound: "#1d4fa8", doubtful: "#b3211a", unsettled: "#5b636f" } as const;

export class Sign {
  /** Its name is what is written on it. */
  readonly sprite: THREE.Sprite;
  private readonly context: CanvasRenderingContext2D;
  private readonly texture: THREE.CanvasTexture;

  constructor() {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [WIDTH, HEIGHT];
    this.context = canvas.getContext("2d")!;
    this.texture = new THREE.CanvasTexture(canvas);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: this.texture, depthTest: false, toneMapped: false }));
    this.sprite.scale.set(WIDE, (WIDE * HEIGHT) / WIDTH, 1);
    this.sprite.visible = false;
  }

  /** Stands beside a force; nowhere where there is none. */
  show(reading: Reading | null): void {
    this.sprite.visible = reading !== null;
    if (!reading) return;
    this.sprite.position.copy(reading.at).setY(reading.at.y + ABOVE);
    const words = `${reading.force} · ${reading.worth}`;
    if (words !== this.sprite.name) this.write(words, COLOURS[reading.standing]);
  }

  dispose(): void {
    this.texture.dispose();
    this.sprite.material.dispose();
  }

  private write(words: string, ground: string): void {
    this.sprite.name = words;
    const { context } = this;
    context.clearRect(0, 0, WIDTH, HEIGHT);
    context.fillStyle = ground;
    context.beginPath();
    context.roundRect(0, 0, WIDTH, HEIGHT, 0.3 * HEIGHT);
    context.fill();
    context.fillStyle = "white";
    context.font = `600 ${0.42 * HEIGHT}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(words, 0.5 * WIDTH, 0.52 * HEIGHT, 0.92 * WIDTH);
    this.texture.needsUpdate = true;
  }
}
