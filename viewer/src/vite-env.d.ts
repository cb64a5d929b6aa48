declare module "*.wasm?url" {
  const dataUrl: string;
  export default dataUrl;
}
